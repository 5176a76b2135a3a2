"""Reproductions with Drake."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from casebook.toy_models import WEIGHT, Evidence, joint, link, robot


def no_gravity() -> Evidence:
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(robot(link("a"), joint("a")), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    bare = plant.CalcInverseDynamics(context, np.zeros(1), forces)[0]
    plant.CalcForceElementsContribution(context, forces)
    mended = plant.CalcInverseDynamics(context, np.zeros(1), forces)[0]
    return Evidence(float(bare), WEIGHT, float(mended), "N m")
