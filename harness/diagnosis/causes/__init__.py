"""What makes two models differ: thought of, weighed against the torques, proved."""
