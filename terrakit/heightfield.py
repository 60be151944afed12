"""Terrain as a regular grid of heights, with named layers beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrakit.errors import InputError
from terrakit.layers import layer_kind

if TYPE_CHECKING:
    import xarray

    from terrakit.compute import Device, DeviceArray
    from terrakit.mesh import TriMesh
    from terrakit.strata import Strata

Field = NDArray[np.float32]
"""A layer on the host: float32, read-only, of the surface's shape."""


class Layer:
    """One float32 field that lives on the host, on a device, or on both.

    It moves only when asked: :meth:`host` downloads it once, :meth:`on` uploads it once.
    """

    __slots__ = ("_device", "_host")

    def __init__(self, values: Field | DeviceArray) -> None:
        self._host: Field | None = None
        self._device: DeviceArray | None = None
        if isinstance(values, np.ndarray):
            self._host = _read_only(values)
        else:
            self._device = values

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows and columns, or the number of vertices."""
        held = self._host if self._host is not None else self._device
        assert held is not None
        return tuple(held.shape)

    @property
    def places(self) -> tuple[str, ...]:
        """Where the values are now: ``host``, the device's name, or both."""
        host = () if self._host is None else ("host",)
        return host if self._device is None else (*host, self._device.device.name)

    def host(self) -> Field:
        """Return the values as a read-only array, downloading them the first time."""
        if self._host is None:
            assert self._device is not None
            self._host = _read_only(self._device.download())
        return self._host

    def not_finite(self) -> int:
        """Return how many values are infinite or no number, without moving the layer."""
        if self._host is None:
            from terrakit.compute.survey import count_not_finite

            assert self._device is not None
            return count_not_finite(self._device)
        return int((~np.isfinite(self._host)).sum())

    def __reduce__(self) -> tuple[type[Layer], tuple[Field]]:
        """Travel to another process on the host, and stay read-only there."""
        return Layer, (self.host(),)

    def on(self, device: Device) -> DeviceArray:
        """Return the values on ``device``, uploading them the first time."""
        if self._device is None or self._device.device.info != device.info:
            self._device = device.upload(self.host())
        return self._device


@dataclass(frozen=True)
class Grid:
    """Where the samples of a heightfield lie.

    Parameters
    ----------
    shape
        Rows and columns; samples are vertices, so ``n`` of them span ``n - 1`` cells.
    spacing
        Distance between neighbouring samples, metres.
    origin
        World x (east) and y (north) of the north-west sample, metres. By default the south-west
        sample is at (0, 0).
    crs
        Coordinate reference system as WKT or ``EPSG:...``, or None for a made-up world.
    """

    shape: tuple[int, int]
    spacing: float
    origin: tuple[float, float] | None = None
    crs: str | None = None

    def __post_init__(self) -> None:
        rows, cols = (int(n) for n in self.shape)
        if rows < 1 or cols < 1:
            raise InputError(f"shape {rows}x{cols}: needs at least one row and one column")
        if not (np.isfinite(self.spacing) and 1e-9 <= self.spacing <= 1e9):
            raise InputError(f"spacing {self.spacing}: must be > 0 m (1e-9 to 1e9)")
        origin = (0.0, (rows - 1) * self.spacing) if self.origin is None else self.origin
        x, y = (float(value) for value in origin)
        if not (np.isfinite(x) and np.isfinite(y)):
            raise InputError(f"origin ({x}, {y}): must be two finite numbers of metres")
        object.__setattr__(self, "shape", (rows, cols))
        object.__setattr__(self, "spacing", float(self.spacing))
        object.__setattr__(self, "origin", (x, y))

    @property
    def north_west(self) -> tuple[float, float]:
        """World x and y of the north-west sample, metres."""
        assert self.origin is not None
        return self.origin

    @property
    def size(self) -> tuple[float, float]:
        """Extent west to east and south to north, metres."""
        rows, cols = self.shape
        return (cols - 1) * self.spacing, (rows - 1) * self.spacing


class Heightfield:
    """A terrain of regularly spaced heights; immutable to its users.

    Row 0 is north and column 0 is west; world axes are +x east, +y north, +z up, in metres.

    Parameters
    ----------
    elevation
        Heights of shape (rows, cols), metres; stored as float32.
    spacing
        Distance between neighbouring samples, metres.
    origin
        World x, y of the north-west sample, metres; by default the south-west sample is (0, 0).
    crs
        Coordinate reference system, carried from import to export.
    layers
        Further fields of the same shape, by the names of :mod:`terrakit.layers`.
    strata
        The beds under the ground, whose top is the layer ``strata_datum``; None without.

    Raises
    ------
    InputError
        If an array is not two-dimensional, real and finite, or shapes differ.
    """

    __slots__ = ("_layers", "grid", "strata")

    grid: Grid
    strata: Strata | None

    def __init__(
        self,
        elevation: ArrayLike | DeviceArray,
        spacing: float,
        origin: tuple[float, float] | None = None,
        crs: str | None = None,
        layers: Mapping[str, ArrayLike | DeviceArray] | None = None,
        strata: Strata | None = None,
    ) -> None:
        first = _layer("elevation", elevation)
        if len(first.shape) != 2:
            raise InputError(f"elevation: needs a 2-D real array, got shape {first.shape}")
        self.grid = Grid((first.shape[0], first.shape[1]), spacing, origin, crs)
        self._layers = {"elevation": first}
        self.strata = strata
        for name, values in (layers or {}).items():
            self._layers[name] = self._fitting(name, values)

    @classmethod
    def on_grid(
        cls,
        grid: Grid,
        elevation: ArrayLike | DeviceArray,
        layers: Mapping[str, ArrayLike | DeviceArray] | None = None,
    ) -> Heightfield:
        """Return a heightfield whose samples lie on ``grid``."""
        return cls(elevation, grid.spacing, grid.north_west, grid.crs, layers)

    @property
    def elevation(self) -> Field:
        """Heights, metres, read-only."""
        return self._layers["elevation"].host()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.grid.shape

    @property
    def spacing(self) -> float:
        """Distance between neighbouring samples, metres."""
        return self.grid.spacing

    @property
    def origin(self) -> tuple[float, float]:
        """World x and y of the north-west sample, metres."""
        return self.grid.north_west

    @property
    def crs(self) -> str | None:
        """Coordinate reference system, or None."""
        return self.grid.crs

    @property
    def layers(self) -> Mapping[str, Layer]:
        """Every layer by name, ``elevation`` first."""
        return MappingProxyType(self._layers)

    @property
    def cell_area(self) -> float:
        """Area that one sample stands for, square metres."""
        return self.spacing**2

    def layer(self, name: str) -> Field:
        """Return a layer on the host, read-only.

        Raises
        ------
        InputError
            If there is no such layer.
        """
        return self._named(name).host()

    def on(self, device: Device, name: str = "elevation") -> DeviceArray:
        """Return a layer on ``device``; kernels must not write to it."""
        return self._named(name).on(device)

    def __contains__(self, name: object) -> bool:
        return name in self._layers

    def __iter__(self) -> Iterator[str]:
        return iter(self._layers)

    def with_layers(self, **layers: ArrayLike | DeviceArray) -> Heightfield:
        """Return a heightfield with these layers added or replaced; the others are shared."""
        new = object.__new__(Heightfield)
        new.grid, new.strata = self.grid, self.strata
        new._layers = dict(self._layers)
        for name, values in layers.items():
            new._layers[name] = self._fitting(name, values)
        return new

    def without_layers(self, *names: str) -> Heightfield:
        """Return a heightfield that lacks these layers; ``elevation`` cannot be dropped."""
        if "elevation" in names:
            raise InputError("elevation: cannot be dropped from a heightfield")
        new = object.__new__(Heightfield)
        new.grid, new.strata = self.grid, self.strata
        new._layers = {n: layer for n, layer in self._layers.items() if n not in names}
        return new

    def with_strata(self, strata: Strata | None) -> Heightfield:
        """Return the same heightfield with other beds under it; everything else is shared."""
        new = self.with_layers()
        new.strata = strata
        return new

    def to_mesh(self) -> TriMesh:
        """Return the same surface as a mesh; its quads are kept for export."""
        from terrakit.mesh import TriMesh

        return TriMesh.from_heightfield(self)

    @classmethod
    def from_xarray(cls, array: xarray.DataArray) -> Heightfield:
        """Return a heightfield from a DataArray with metric ``y``, ``x`` coordinates.

        Raises
        ------
        InputError
            If a coordinate is missing or not evenly spaced, or the two spacings differ.
        """
        return _from_xarray(array)

    def to_xarray(self) -> xarray.Dataset:
        """Return every layer as a Dataset with ``y`` (north to south) and ``x`` in metres."""
        import xarray

        rows, cols = self.shape
        x, y = self.origin
        coordinates = {
            "y": ("y", y - np.arange(rows) * self.spacing, {"units": "m"}),
            "x": ("x", x + np.arange(cols) * self.spacing, {"units": "m"}),
        }
        fields = {}
        for name, layer in self._layers.items():
            kind = layer_kind(name)
            about = {"units": kind.unit, "long_name": kind.meaning} if kind else {}
            fields[name] = (("y", "x"), layer.host(), about)
        attributes = {"spacing": self.spacing, **({"crs": self.crs} if self.crs else {})}
        return xarray.Dataset(fields, coordinates, attributes)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        values = np.asarray(self.elevation, dtype=dtype)
        return values.copy() if copy else values

    def __repr__(self) -> str:
        rows, cols = self.shape
        return f"Heightfield({rows}x{cols}, {self.spacing:g} m, layers={list(self._layers)})"

    def _repr_png_(self) -> bytes:
        """Return a hillshade for notebooks."""
        import io

        from PIL import Image

        from terrakit.shading import relief_image

        step = max(1, max(self.shape) // 512)
        picture = relief_image(self.elevation[::step, ::step], self.spacing * step)
        stream = io.BytesIO()
        Image.fromarray(picture).save(stream, "PNG")
        return stream.getvalue()

    def _named(self, name: str) -> Layer:
        try:
            return self._layers[name]
        except KeyError:
            known = ", ".join(self._layers)
            raise InputError(f"layer {name!r}: the terrain has none; it has: {known}") from None

    def _fitting(self, name: str, values: ArrayLike | DeviceArray) -> Layer:
        layer = _layer(name, values)
        if layer.shape != self.shape:
            raise InputError(f"layer {name!r}: shape {layer.shape}, the terrain is {self.shape}")
        return layer


def _layer(name: str, values: ArrayLike | DeviceArray | Layer) -> Layer:
    if isinstance(values, Layer):
        return values
    if hasattr(values, "download"):
        return Layer(values)  # type: ignore[arg-type]
    return Layer(checked_field(name, values))


def checked_field(name: str, values: Any) -> Field:
    """Return ``values`` as a C-contiguous float32 array that nobody else can change.

    Raises
    ------
    InputError
        If the values are not real numbers, overflow float32, or are not finite.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise InputError(f"{name}: needs a 2-D real array, got {array.dtype}")
    with np.errstate(over="ignore"):
        field = np.array(array, dtype=np.float32, order="C", copy=True)
    wrong = ~np.isfinite(field)
    if wrong.any():
        place = tuple(int(i) for i in np.argwhere(wrong)[0])
        at = ", ".join(f"{axis} {i}" for axis, i in zip(("row", "column"), place, strict=False))
        raise InputError(
            f"{name}: {int(wrong.sum())} of {wrong.size} values are not finite (first at {at}); "
            "fill them first, e.g. --fill nearest"
        )
    return field


def _read_only(values: NDArray[Any]) -> Field:
    field = values if values.dtype == np.float32 else values.astype(np.float32)
    field = np.ascontiguousarray(field).view()
    field.flags.writeable = False
    return field


def _from_xarray(array: xarray.DataArray) -> Heightfield:
    if array.ndim != 2:
        raise InputError(f"elevation: needs a 2-D real array, got {array.ndim} dimensions")
    steps = []
    first = []
    for axis in array.dims:
        if axis not in array.coords or array.sizes[axis] < 2:
            raise InputError(f"dimension {axis!r}: needs a coordinate in metres and two samples")
        along = np.asarray(array.coords[axis].values, dtype=np.float64)
        gaps = np.diff(along)
        if not np.allclose(gaps, gaps[0], rtol=1e-4, atol=0):
            raise InputError(f"dimension {axis!r}: samples are not evenly spaced; resample first")
        steps.append(float(gaps.mean()))
        first.append(along)
    if abs(abs(steps[0]) - abs(steps[1])) > 1e-4 * abs(steps[0]):
        raise InputError(
            f"spacing {abs(steps[1]):g} x {abs(steps[0]):g} m: cells must be square; resample first"
        )
    values = np.asarray(array.values)
    if steps[0] > 0:  # y rises with the row: south first
        values = values[::-1]
    if steps[1] < 0:
        values = values[:, ::-1]
    crs = array.attrs.get("crs")
    return Heightfield(
        values,
        abs(steps[1]),
        (float(first[1].min()), float(first[0].max())),
        str(crs) if crs else None,
    )
