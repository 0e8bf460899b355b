"""Tabs of the page: each declares its controls, and makes a result of their settings."""

from cvtimg.explore.tabs.base import Tab
from cvtimg.explore.tabs.colors_tab import ColorsTab
from cvtimg.explore.tabs.design_tab import DesignTab
from cvtimg.explore.tabs.mesh_tab import MeshTab
from cvtimg.explore.tabs.mosaic_tab import MosaicTab
from cvtimg.explore.tabs.palette_tab import PaletteTab
from cvtimg.explore.tabs.restore_tab import RestoreTab
from cvtimg.explore.tabs.segments_tab import SegmentsTab
from cvtimg.explore.tabs.sphere_tab import SphereTab
from cvtimg.explore.tabs.stipple_tab import StippleTab

#: All tabs by name, in the order of the page.
TABS: dict[str, Tab] = {
    tab.name: tab
    for tab in (
        ColorsTab(),
        PaletteTab(),
        SegmentsTab(),
        StippleTab(),
        MosaicTab(),
        RestoreTab(),
        MeshTab(),
        SphereTab(),
        DesignTab(),
    )
}
