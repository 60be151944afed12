"""Landforms by name: forms of the land that a geographer would know."""

from __future__ import annotations

from terrakit.operators import Generator


def landforms() -> list[type[Generator]]:
    """Return all landforms."""
    from terrakit_generators.landforms.archipelago import Archipelago
    from terrakit_generators.landforms.atoll import Atoll
    from terrakit_generators.landforms.basin import Basin
    from terrakit_generators.landforms.caldera import Caldera
    from terrakit_generators.landforms.canyon import Canyon
    from terrakit_generators.landforms.cone import Cone
    from terrakit_generators.landforms.crater import Crater
    from terrakit_generators.landforms.cuesta import Cuesta
    from terrakit_generators.landforms.dunes import Dunes
    from terrakit_generators.landforms.fjord import Fjord
    from terrakit_generators.landforms.gorge import Gorge
    from terrakit_generators.landforms.island import Island
    from terrakit_generators.landforms.lone_hill import LoneHill
    from terrakit_generators.landforms.maar import Maar
    from terrakit_generators.landforms.meander import Meander
    from terrakit_generators.landforms.mesa import Mesa
    from terrakit_generators.landforms.mountain_range import MountainRange
    from terrakit_generators.landforms.plain import Plain
    from terrakit_generators.landforms.ridge import Ridge
    from terrakit_generators.landforms.shield_volcano import ShieldVolcano
    from terrakit_generators.landforms.stratovolcano import Stratovolcano
    from terrakit_generators.landforms.thufur import Thufur
    from terrakit_generators.landforms.undulating_plain import UndulatingPlain
    from terrakit_generators.landforms.valley import Valley

    return [
        Archipelago,
        Atoll,
        Basin,
        Caldera,
        Canyon,
        Cone,
        Crater,
        Cuesta,
        Dunes,
        Fjord,
        Gorge,
        Island,
        LoneHill,
        Maar,
        Meander,
        Mesa,
        MountainRange,
        Plain,
        Ridge,
        ShieldVolcano,
        Stratovolcano,
        Thufur,
        UndulatingPlain,
        Valley,
    ]
