"""A loop: the same steps over and over, so that processes take turns."""

from __future__ import annotations

from typing import Any, ClassVar

from terrakit.heightfield import Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Erosion
from terrakit.parameters import parameter
from terrakit.passes import Pass, Passes
from terrakit.running import Run
from terrakit.sources import OfSteps, Steps


class Repeat(Erosion):
    """Run a list of steps over and over, so that processes interleave.

    In nature rivers cut and slopes slide at the same time. Two long steps one after the other leave
    what the second makes; many short ones in turn come to what both agree on. A pass hands its
    terrain with all layers to the next.

    Notes
    -----
    Every pass takes the whole time that its steps are given: 20 passes of 1000 years are 20000
    years. Schedules inside run over the whole loop. The first pass draws the random numbers that
    the steps would draw on their own, each later one its own: other rain falls. Numbers that belong
    to the ground, such as those by which rivers wind, stay.
    """

    name = "repeat"
    surfaces: ClassVar[Any] = OfSteps("surfaces", (Heightfield, TriMesh))
    reads: ClassVar[Any] = OfSteps("reads", ("elevation",))
    uses: ClassVar[Any] = OfSteps("uses", ())
    writes: ClassVar[Any] = OfSteps("writes", ("elevation",))
    fields: ClassVar[Any] = OfSteps("fields", 4)
    idle: ClassVar = {"times": 0}
    trial: ClassVar = {"times": 2, "steps": [{"use": "thermal", "distance": 20.0}]}

    times: int = parameter(10, "How often the steps are run.", ge=0, le=100000)
    steps: Steps = parameter(..., "What is done in every pass, in order.")

    def portion(self, start: float, end: float) -> Repeat:
        """Return the loop with its steps cut down to a part of their time, as many passes."""
        return self.model_copy(update={"steps": self.steps.portion(start, end)})

    def erode(self, surface: Heightfield | TriMesh, run: Run) -> Heightfield | TriMesh:
        """Return the surface after the last pass."""
        times = self.times
        passes = Passes(run, [Pass(n, n / times, (n + 1) / times) for n in range(times)])
        for each in passes:
            surface = passes.through(each, self.steps, surface)
            run.offer(lambda now=surface: now)  # type: ignore[misc]
        passes.close(surface)
        return surface
