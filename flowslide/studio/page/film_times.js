// The frames of a film and the times [s] at which they were: both may lie between two frames.

export function timeAt(times, frame) {
  const k = Math.floor(frame);
  return times[k] + (frame - k) * ((times[k + 1] ?? times[k]) - times[k]);
}

export function frameAt(times, time) {
  const k = times.findLastIndex((one) => one <= time);
  return k === times.length - 1 ? k : k + (time - times[k]) / (times[k + 1] - times[k]);
}
