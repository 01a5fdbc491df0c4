"""The end of a study: its document is printed, then figures, page and summary are written."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rearl_jax.document.document import Document
from rearl_jax.document.terminal import print_document
from rearl_jax.results import Study


def publish_document(
    study: Study,
    document: Document,
    config: Any,
    summary: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    draw: Callable[[], Mapping[str, bytes]] = dict,
    *,
    data_id: str | None = None,
    player: Callable[[], Any] | None = None,
    show: bool = True,
) -> None:
    """Prints the document and writes the figures as `NAME.png`, `page.html` and, last of all, `summary.json`.

    Args:
        study: Folder of the study.
        document: Its document.
        config: Record of the task.
        summary: Figures of the task, as in `Study.write_summary`.
        draw: Function that returns the figures, PNG by name; called after the document is printed, because matplotlib
            is slow to import.
        data_id: Identity of the data; None without data.
        player: Function that returns the replayed scenes, an `html.Player`; called likewise. None for none.
        show: Whether the document is printed.
    """
    if show:
        print_document(document)

    # Imported after the document is printed, because jinja2 is slow to import.
    from rearl_jax.document.html import page_of

    figures = draw()
    for name, png in figures.items():
        study.write_bytes(f"{name}.png", png)
    scenes = None if player is None else player()
    study.write_text("page.html", page_of(document, config, figures, data_id=data_id, player=scenes))
    study.write_summary(summary)
