# %% [markdown]
# # Screwgauge in a notebook
#
# Open this file in an editor that knows `# %%` cells, or make a notebook of it: `jupytext --to ipynb notebook.py`.

# %%
import screwgauge

scene = screwgauge.load_scene("slider-crank")
scene

# %% [markdown]
# Three engines compute the same motion. The result shows its verdict and its tables.

# %%
results = screwgauge.run(scene.at([0.01 * k for k in range(101)]), quantities=["joint_position", "actuator_force"])
results

# %% [markdown]
# A quantity is a table: times by engine and component.

# %%
torque = results.frame("actuator_force")
torque.describe()

# %%
assert abs(torque["screw"] - torque["mujoco"]).max().max() < 1e-9  # [N m]
results.figure("actuator_force")

# %% [markdown]
# Does the torque depend on the load on the piston? A scene is data; a changed one is another scene.

# %%
unloaded = screwgauge.run(scene.under(loads=()).at(results.times), engines=["screw"], quantities=["actuator_force"])
difference = torque["screw"] - unloaded.frame("actuator_force")["screw"]
difference.abs().max()

# %% [markdown]
# Two models of one machine: here two mechanisms that are the same but for how they are driven.

# %%
diagnosis = screwgauge.diagnose("stewart", "stewart-legs")
diagnosis

# %%
page = results.to_html()  # the whole report as text; `results.write("out")` leaves it with all tables
len(page)
