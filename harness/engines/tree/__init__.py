"""What engines with an open tree share: closing its loops, forces, integration, reading cut joints."""
