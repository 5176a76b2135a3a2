"""Causes of facts, their shares of the torque difference, and likely slips behind them."""
