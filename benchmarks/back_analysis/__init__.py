"""What the back-analysis must show: measured figures compared with those asked."""
