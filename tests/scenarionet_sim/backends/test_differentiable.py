"""The bicycle in torch: equal to the compiled law and reward, and gradients equal to finite differences."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_data.errors import BadParameter  # noqa: E402
from scenarionet_sim.backends.base import Drive  # noqa: E402
from scenarionet_sim.backends.bicycle_kernels import drive_bicycles  # noqa: E402
from scenarionet_sim.backends.differentiable import (  # noqa: E402
    DifferentiableVehicle,
    arc_along,
    clearance,
    step_rewards,
)
from scenarionet_sim.backends.fleet import Fleet  # noqa: E402
from scenarionet_sim.backends.kinematic import Kinematic, _columns  # noqa: E402
from scenarionet_sim.environments.batched import BatchedEnvironment  # noqa: E402
from scenarionet_sim.environments.config import EnvConfig  # noqa: E402
from scenarionet_sim.environments.observation import Observation  # noqa: E402
from scenarionet_sim.policies.external import External  # noqa: E402
from scenarionet_sim.policies.objects import ego  # noqa: E402
from scenarionet_sim.policies.replay import Replay  # noqa: E402
from scenarionet_sim.scenarios.selection import Scenarios  # noqa: E402
from scenarionet_sim.task.task import Reward  # noqa: E402
from scenarionet_sim.worlds.world import World  # noqa: E402
from tests.fixtures.scenarios import make_scenario  # noqa: E402

LENGTH, COUNT, STEPS = 4.6, 500, 30
DRIVES = (Drive(), Drive(drag=0.01, rolling=0.2, reverse=5.0, max_speed=12.0))


def states(count: int, seed: int = 0) -> np.ndarray:
    """Motions (count, 7), some of them standing, some backwards, some sliding."""
    rng = np.random.default_rng(seed)
    heading, speed, slip = rng.uniform(-np.pi, np.pi, count), rng.uniform(-3.0, 25.0, count), rng.normal(0, 0.1, count)
    speed[: count // 20] = 0.0
    vx, vy = speed * np.cos(heading + slip), speed * np.sin(heading + slip)
    return np.column_stack((rng.normal(0, 50, (count, 3)), heading, vx, vy, np.zeros(count)))


def actions(count: int, steps: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, steps, 2))


@pytest.mark.parametrize("drive", DRIVES)
def test_motion_is_that_of_the_compiled_law(drive):
    backend = Kinematic(drive, grip=6.0)
    first, given = states(COUNT), actions(COUNT, STEPS)
    vehicle = DifferentiableVehicle(backend, LENGTH)
    found = vehicle.rollout(torch.from_numpy(first), torch.from_numpy(given)).numpy()
    agents = np.column_stack((np.zeros(COUNT), np.arange(COUNT))).astype(np.int32)
    numbers = _columns(np.array([(*vars(drive).values(), backend.grip)]))
    vehicles, size = np.repeat(numbers[None], COUNT, axis=1), np.full((1, COUNT, 3), LENGTH)
    motion = first[None].copy()
    for step in range(STEPS):
        drive_bicycles(agents, np.ascontiguousarray(given[:, step]), 0.1, backend.substeps, vehicles, size, motion)
        turned = np.abs(np.angle(np.exp(1j * (found[:, step + 1, 3] - motion[0, :, 3]))))
        assert turned.max() < 1e-9
        rest = [0, 1, 2, 4, 5, 6]
        assert np.abs(found[:, step + 1, rest] - motion[0][:, rest]).max() < 1e-9


def test_gradients_are_finite_differences():
    """With respect to actions and initial states, on a path that bends; away from the kinks of the limits."""
    vehicle = DifferentiableVehicle(Kinematic(Drive(drag=0.001, rolling=0.05)), LENGTH)
    x = np.linspace(0.0, 120.0, 61)
    y = 0.002 * x**2
    arc = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    path = torch.from_numpy(np.column_stack((x, y, 0 * x, 0 * x, arc)))
    first = torch.tensor([1.0, 0.3, 0.0, 0.02, 8.0, 0.1, 0.0], dtype=torch.float64)
    given = torch.from_numpy(np.random.default_rng(2).uniform([-0.2, -0.3], [0.2, 0.6], (STEPS, 2)))
    box = torch.tensor([LENGTH, 1.9], dtype=torch.float64)
    other = torch.tensor([60.0, 6.0, 0.0, 0.2, 0.0, 0.0, 0.0], dtype=torch.float64)

    def total(motion, acts):
        motions = vehicle.rollout(motion, acts)
        rewards = step_rewards(motions, acts, path, Reward(smoothness=0.5)).sum()
        return rewards + clearance(motions[-1], box, other, box)

    variables = first.clone().requires_grad_(), given.clone().requires_grad_()
    total(*variables).backward()
    worst, h = 0.0, 1e-6
    for which, values in enumerate((first, given)):
        flat = values.reshape(-1)
        for k in range(len(flat)):
            sides = []
            for sign in (1.0, -1.0):
                moved = flat.clone()
                moved[k] += sign * h
                both = [first, given]
                both[which] = moved.reshape(values.shape)
                sides.append(float(total(*both)))
            slope = (sides[0] - sides[1]) / (2.0 * h)
            worst = max(worst, abs(slope - float(variables[which].grad.reshape(-1)[k])))
    assert worst < 1e-4
    assert variables[0].grad[4] > 0.5, "faster is farther"


def test_gradients_at_standstill_and_in_a_slide_are_finite():
    vehicle = DifferentiableVehicle()
    first, given = torch.from_numpy(states(200, 3)).requires_grad_(), torch.from_numpy(actions(200, 5)).requires_grad_()
    vehicle.rollout(first, given).sum().backward()
    assert torch.isfinite(first.grad).all() and torch.isfinite(given.grad).all()
    assert (first.grad != 0).any(0)[[0, 1, 2, 3, 4, 5]].all() and (given.grad != 0).any(0).any(0).all()


def test_rewards_are_those_of_the_environment():
    world = World.from_scenario(make_scenario(5, num_steps=60))
    config = EnvConfig(Scenarios("."), (Replay(), External(ego)), Kinematic())
    core = BatchedEnvironment(config, Observation(config.sensors, "flat"), [world])
    row = core.agents[0, 1]
    paths = world.paths
    path = torch.from_numpy(paths.path[paths.path_offsets[row] : paths.path_offsets[row + 1]].astype(np.float64))
    first = torch.from_numpy(core.simulation.state.motion[0, row].copy())
    vehicle = DifferentiableVehicle(length=float(world.size[row, 0]))
    given, found = np.random.default_rng(3).uniform([-0.1, 0.2], [0.1, 0.9], (20, 2)), []
    for action in given:
        core.step([action])
        if core.status[0]:
            break
        found.append(core.numbers[0, 0] + core.numbers[0, 1])
    assert len(found) >= 5
    acts = torch.from_numpy(given[: len(found)])
    expected = step_rewards(vehicle.rollout(first, acts), acts, path, config.reward)
    assert np.abs(expected.numpy() - found).max() < 1e-9


def test_the_arc_goes_on_beyond_both_ends():
    path = torch.tensor([[0.0, 0, 0, 0, 0], [10.0, 0, 0, 0, 10], [10.0, 10, 0, 0, 20]], dtype=torch.float64)
    points = torch.tensor([[-2.0, 1], [4.0, 3], [11.0, -1], [12.0, 13]], dtype=torch.float64)
    assert arc_along(points, path).tolist() == [-2.0, 4.0, 10.0, 23.0]


def test_clearance_by_hand():
    size = torch.tensor([4.0, 2.0])
    here, beside, across = torch.zeros(7), torch.zeros(7), torch.zeros(7)
    beside[:2], across[:2], across[3] = torch.tensor([1.0, 3.0]), torch.tensor([3.5, 0.0]), np.pi / 2
    assert float(clearance(here, size, beside, size)) == pytest.approx(1.0)
    assert float(clearance(here, size, across, size)) == pytest.approx(0.5)
    assert float(clearance(here, size, 0.5 * across, size)) < 0.0


def test_a_fleet_is_refused():
    with pytest.raises(BadParameter, match="expected a Drive"):
        DifferentiableVehicle(Kinematic(Fleet()))
