"""The paper, checked: each of its errata measured by running the printed form and the right one."""
