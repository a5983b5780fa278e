"""The compiled spatial plant, for robots alone and side by side, without a world around it."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from support.dense_spatial_step import Episode, Moment

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.plant.spatial import layout
from usm_gym.plant.spatial.step import advance
from usm_gym.plant.thrusters import command
from usm_gym.spatial_packing import spatial_plant, spatial_row
from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]


@piece
def run(blocks, plant, actions, like, lanes, stride):
    """One control period of blocks of `lanes` robots."""
    rows = layout.thruster_rows(plant.links, plant.thrusters)
    for k in range(blocks.shape[0]):
        for lane in range(lanes):
            command(blocks[k], lanes, lane, rows, actions[k * lanes + lane])
        advance(block_at(blocks, k, like), like, spread(0.0), stride, plant)


@compiled
def run_singles(blocks, plant, actions):
    """`run` for blocks of one robot each."""
    run(blocks, plant, actions, 0.0, 1, WIDTH)


@compiled
def run_lanes(blocks, plant, actions):
    """`run` for blocks of `WIDTH` robots each."""
    run(blocks, plant, actions, spread(0.0), WIDTH, 1)


class Swimmers:
    """Copies of a robot, each in an episode of its own, all with the same physics step."""

    def __init__(
        self, robot: SpatialRobot, episodes: list[Episode], moments: list[Moment], substeps: int = 1
    ) -> None:
        first = episodes[0]
        self.plant = spatial_plant(
            robot,
            first.step,
            substeps=substeps,
            euler=first.euler,
            shifts=max(episode.shifts.size for episode in episodes),
            sinusoids=max(episode.frequencies.size for episode in episodes),
        )
        pairs = zip(episodes, moments, strict=True)
        self.rows = np.stack([self.packed(robot, *pair) for pair in pairs])

    def step(self, actions: ArrayLike) -> None:
        """Advance all by a control period, each alone; `actions` is (robots, thrusters)."""
        given = np.array(np.broadcast_to(actions, (len(self.rows), self.plant.thrusters)))
        run_singles(self.rows, self.plant, given)

    def step_side_by_side(self, actions: Array) -> None:
        """Advance all by a control period, `WIDTH` at a time, the last block filled up."""
        robots, rows = self.rows.shape
        blocks = -(-robots // WIDTH)
        wanted = np.arange(blocks * WIDTH) % robots
        lanes = self.rows[wanted].reshape(blocks, WIDTH, rows).swapaxes(1, 2).reshape(blocks, -1)
        run_lanes(lanes, self.plant, actions[wanted])
        self.rows = lanes.reshape(blocks, rows, WIDTH).swapaxes(1, 2).reshape(-1, rows)[:robots]

    def packed(self, robot: SpatialRobot, episode: Episode, moment: Moment) -> Array:
        """Return the rows of a robot."""
        plant, one = self.plant, 1.0
        row = spatial_row(
            robot,
            plant,
            coefficients=episode.coefficients,
            filter_frequency=episode.frequency,
            time_constant=episode.time_constant,
            dead_band=episode.dead_band,
            link_factors=one if episode.link_factors is None else episode.link_factors,
            thruster_gains=one if episode.gains is None else episode.gains,
        )
        row[layout.LIMIT] = episode.limit
        row[layout.WATER : layout.WATER + 3] = row[layout.MEAN : layout.MEAN + 3] = episode.current
        waves = np.column_stack([episode.amplitudes, episode.phases, episode.frequencies])
        row[layout.SINUSOID : layout.SINUSOID + waves.size] = waves.ravel()
        shifts = episode.shifts.size
        row[layout.SHIFT_STEP : layout.SHIFT_STEP + shifts] = episode.shifts / episode.step
        for first, sizes in zip(
            (layout.PAN_SHIFT, layout.TILT_SHIFT), episode.sizes.T, strict=True
        ):
            row[first : first + shifts] = sizes
        if episode.shares is not None:
            joints = plant.links - 1
            for quantity, shares in zip(
                (layout.PAN_SHARE, layout.TILT_SHARE), episode.shares, strict=True
            ):
                first = layout.row_of(quantity, plant.links)
                row[first : first + joints] = shares
        for rows, part in zip(self.places(), moment, strict=True):
            row[rows] = part
        return row

    def moment(self, robot: int = 0) -> Moment:
        """Return the moment that a robot is in."""
        parts = [self.rows[robot, rows] for rows in self.places()]
        return Moment(int(parts[0]), *parts[1:])

    def places(self) -> tuple[NDArray[np.int64], ...]:
        """Where a row has the parts of a moment, as they are shaped."""
        links = self.plant.links

        def header(row: int, size: int = 3) -> NDArray[np.int64]:
            return row + np.arange(size)

        def joints(quantity: int) -> NDArray[np.int64]:
            return layout.row_of(quantity, links) + np.arange(links - 1)

        by_link = [
            [
                layout.row_of(first + axis, links) + link
                for first in (layout.LINK_A, layout.ALPHA)
                for axis in range(3)
            ]
            for link in range(links)
        ]
        force = layout.thruster_row(layout.FORCE, links, self.plant.thrusters)
        return (
            np.array(layout.CLOCK),
            header(layout.P),
            header(layout.Q, 4),
            header(layout.V),
            header(layout.W),
            joints(layout.PHI),
            joints(layout.PHI_DOT),
            np.stack([header(layout.PAN), header(layout.TILT)]),
            header(force, self.plant.thrusters),
            header(layout.A),
            header(layout.DW),
            joints(layout.PHI_DDOT),
            np.array(by_link),
        )
