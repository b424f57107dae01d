"""What the back-analysis must show: measured figures beside those asked."""
