#!/usr/bin/env bash
# What a machine with torch, numpy, scipy and h5py lacks, in one small file; no network needed there.
#
#   benchmarks/gpu/bundle.sh pack   [FOLDER]           here; default build/gpu-bundle
#   benchmarks/gpu/bundle.sh unpack [FOLDER] [TARGET]  there; default TARGET build/gpu-site
#
# For Python 3.12 on Linux, x86-64. `unpack` prints the exports to be made; only bash and python3 are
# needed there. Taichi goes without its C library, examples and symbol tables: its 163 MB become 19.
set -euo pipefail
cd "$(dirname "$0")/../.."

NAMES="taichi dill colorama pydantic pydantic-core annotated-types typing-inspection
  typing-extensions shapely loky cloudpickle shtab pyyaml rich"
FOLDER=${2:-build/gpu-bundle}

pack() {
  local work; work=$(mktemp -d)
  trap "rm -rf '$work'" EXIT
  local wanted=()
  for name in $NAMES; do
    wanted+=("$(grep -i "^${name//-/[-_]}==" constraints.txt)")
  done
  python3 -m pip download --quiet --no-deps --only-binary=:all: --implementation cp \
    --python-version 3.12 --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 \
    --platform manylinux_2_24_x86_64 --platform manylinux2014_x86_64 --dest "$work/wheels" \
    "${wanted[@]}"
  for wheel in "$work"/wheels/*.whl; do
    python3 -m zipfile -e "$wheel" "$work/site"
  done
  cd "$work/site"
  # The CUDA and x64 runtimes (taichi/_lib/runtime/*.bc) stay: kernels are linked with them.
  rm -rf taichi/_lib/c_api taichi/examples taichi/assets ./*.data
  find . -type d -name tests -prune -exec rm -rf {} +
  find . \( -name '*.pyi' -o -name '*.pyx' -o -name '*.c' -o -name '*.h' \) -delete
  find . -name '*.so*' -type f -exec strip --strip-all {} +
  # Taichi is linked with X11, for windows that nobody opens: its names alone, where there is none.
  mkdir driver
  nm -D --undefined-only taichi/_lib/core/*.so | awk '$2 ~ /^X[A-Z]/ {print "void " $2 "(void) {}"}' |
    gcc -shared -s -o driver/libX11.so.6 -x c -
  cd - > /dev/null
  mkdir -p "$FOLDER"
  tar --sort=name --mtime=@0 --owner=0 --group=0 -C "$work/site" -cf - . |
    xz --x86 --lzma2=preset=9e,dict=128MiB -T1 > "$FOLDER/site.tar.xz"
  ls -l "$FOLDER/site.tar.xz"
}

unpack() {
  local target=${3:-build/gpu-site}
  python3 - "$FOLDER/site.tar.xz" "$target" << 'PYTHON'
import sys, tarfile
with tarfile.open(sys.argv[1], "r:xz") as archive:
    archive.extractall(sys.argv[2], filter="data")
PYTHON
  target=$(cd "$target" && pwd)
  local known driver
  known=$(ldconfig -p 2> /dev/null || true)
  if grep -q 'libX11\.so\.6 ' <<< "$known"; then rm "$target/driver/libX11.so.6"; fi
  # Taichi asks for libcuda.so; some drivers are mounted with libcuda.so.1 alone.
  driver=$(awk '/libcuda\.so\.1 / {print $NF; exit}' <<< "$known")
  if [ -n "$driver" ]; then ln -sf "$driver" "$target/driver/libcuda.so"; fi
  echo "export LD_LIBRARY_PATH=$target/driver:${LD_LIBRARY_PATH:-}"
  echo "export PYTHONPATH=$target:${PYTHONPATH:-}"
}

case ${1:-} in
  pack) pack ;;
  unpack) unpack "$@" ;;
  *) echo "usage: $0 pack|unpack [FOLDER] [TARGET]" >&2; exit 2 ;;
esac
