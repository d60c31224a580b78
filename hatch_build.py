"""Pack the texts that the wheel excludes one by one into one file, which `tools/texts.py` reads."""

import json
import lzma
import tempfile
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Pack(BuildHookInterface):
    """The hook: of wheels; an editable installation reads the files themselves."""

    def initialize(self, version, build_data):
        """Add `actionopt/data.xz`: the texts as JSON, by their paths in the package."""
        if version == "editable":
            return
        package = Path(self.root) / "actionopt"
        files = sorted(
            f
            for pattern in self.build_config.target_config["exclude"]
            for f in package.parent.glob(pattern)
        )
        texts = {f.relative_to(package).as_posix(): f.read_text("utf-8") for f in files}
        self.folder = tempfile.TemporaryDirectory()
        packed = Path(self.folder.name) / "data.xz"
        packed.write_bytes(lzma.compress(json.dumps(texts, ensure_ascii=False).encode(), preset=9))
        build_data["force_include"][str(packed)] = "actionopt/data.xz"
