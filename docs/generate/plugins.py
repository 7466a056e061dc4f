"""Write spi/plugins/index.json: which plug-in of this repository offers which name.

    python docs/generate/plugins.py

The core reads it for messages where a plug-in is left out.

Short form: without arguments
"""

import json
from pathlib import Path
from typing import Any

from spi import plugins

FOLDER = Path(plugins.__file__).parent
#: Fields of a plug-in that are no registries.
ABOUT = ("name", "needs")


def index() -> dict[str, dict[str, str]]:
    """Registry -> name -> plug-in, of all plug-ins whose folders are here."""
    whole: dict[str, dict[str, str]] = {}
    for name in sorted(path.parent.name for path in FOLDER.glob("*/plugin.py")):
        plugin: Any = plugins.installed()[name]
        for field in plugin._fields:
            if field not in ABOUT and getattr(plugin, field):
                whole.setdefault(field, {}).update(dict.fromkeys(getattr(plugin, field), name))
    return {field: whole[field] for field in plugins.Plugin._fields if field in whole}


if __name__ == "__main__":
    (FOLDER / plugins.INDEX).write_text(json.dumps(index(), indent=2) + "\n", encoding="utf-8")
