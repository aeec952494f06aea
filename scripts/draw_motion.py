"""Draw the pictures of docs/howto/motion.md: run `.venv/bin/python scripts/draw_motion.py`.

The page's own commands make them, in a folder that is removed.
"""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import OpenImageIO as oiio

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "motion.md"
PICTURES = {
    "street/render.png": "motion-street.jpg",
    "shaken/render.png": "motion-shaken.jpg",
    "turned/render.png": "motion-turned.jpg",
    "passing/strip.png": "motion-strip.jpg",
}


def main() -> None:
    """Run the commands, and copy what they make."""
    text = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, content in re.findall(r'```text title="([^"]+)"\n(.*?)```', text, re.DOTALL):
            (folder / title).write_text(content, encoding="utf-8")
        for command in re.findall(r"^\$ vcam (.*)$", text, re.MULTILINE):
            words = [sys.executable, "-m", "vcam_cli.commands.main", *shlex.split(command)]
            subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        for made, drawn in PICTURES.items():
            picture = oiio.ImageBuf(str(folder / "out" / made))
            picture.specmod().attribute("CompressionQuality", 85)
            if not picture.write(str(PAGE.parent / drawn)):
                raise OSError(picture.geterror())
            print(PAGE.parent / drawn)


if __name__ == "__main__":
    main()
