"""Common steps for engines of any formulation; `screwgauge.plugins` names and explains them."""
