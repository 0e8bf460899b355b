"""Tabs of the page: each declares its controls, and makes a result of their settings."""

from cvtimg._shared.budgets import PIXELS_AT_ONCE
from cvtimg._shared.choices import Options
from cvtimg.explore.controls import UnfitRequestError, parse_settings
from cvtimg.explore.layers import Window
from cvtimg.explore.opened import Picture
from cvtimg.explore.store import Store
from cvtimg.explore.tabs.artwork_tabs import MosaicTab, StippleTab
from cvtimg.explore.tabs.base import Request, Tab
from cvtimg.explore.tabs.colors_tabs import ColorsTab, PaletteTab
from cvtimg.explore.tabs.restore_tab import RestoreTab
from cvtimg.explore.tabs.segments_tabs import MeshTab, SegmentsTab
from cvtimg.explore.tabs.sheet_tabs import DesignTab, SphereTab

_KINDS = (ColorsTab, PaletteTab, SegmentsTab, StippleTab, MosaicTab, RestoreTab, MeshTab, SphereTab, DesignTab)
#: All tabs by name, in the order of the page.
TABS: dict[str, Tab] = {kind.name: kind() for kind in _KINDS}


def requested(store: Store, asked: Options, *, is_draft: bool = False) -> tuple[Tab, Request]:
    """Return the tab of a request that a page sent, and what it asks of it, checked."""
    tab = TABS.get(str(asked.get("tab")))
    if tab is None:
        raise UnfitRequestError("there is no such tab")
    settings = parse_settings(tab.controls, asked.get("settings"))
    picture = None if tab.sheet else opened(store, asked)
    size = picture.size if picture else tab.sheet or (1, 1)
    most = tab.draft_pixels(settings) if is_draft else PIXELS_AT_ONCE
    window = Window.of(asked.get("view"), size, most)
    return tab, Request(picture, settings, store, window, tab.for_frames)


def opened(store: Store, asked: Options) -> Picture:
    """Return the picture of a request: of several the frame or page, and of several channels what is chosen."""
    whole = store.picture(str(asked.get("picture"))).of_channels(asked.get("channel", 0), asked.get("tints"))
    return whole.frame(frame_of(asked))


def frame_of(asked: Options) -> int:
    """Return the number of the frame or page that is shown."""
    number = asked.get("frame", 0)
    return number if isinstance(number, int) else 0
