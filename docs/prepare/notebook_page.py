"""Turns a notebook into a page and its pictures."""

import base64
import json

# Pictures, and how the names of their files end.
KINDS = {"image/png": "png", "image/svg+xml": "svg"}


def parts(path, source):
    """The page of a notebook, and its pictures by their names.

    Args:
        path: The notebook.
        source: Where a reader finds it.
    """
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    pictures, blocks = {}, []
    for cell in cells:
        words = "".join(cell["source"])
        blocks.append(words if cell["cell_type"] == "markdown" else f"```python\n{words}\n```")
        for output in cell.get("outputs", ()):
            data = output.get("data", {"text/plain": output.get("text", [])})
            kind = next((kind for kind in KINDS if kind in data), None)
            if kind:
                name = f"{path.stem}-{cell['id']}.{KINDS[kind]}"
                drawn = "".join(data[kind])
                text = kind == "image/svg+xml"
                pictures[name] = drawn.encode() if text else base64.b64decode(drawn)
                blocks.append(f"![{cell['metadata']['alt']}]({name})")
            elif "text/markdown" in data:
                blocks.append("".join(data["text/markdown"]))
            else:
                blocks.append(f"```text\n{''.join(data['text/plain']).rstrip()}\n```")
    blocks.insert(1, f"From `{source}`, with what it found when it was run.")
    return "\n\n".join(blocks), pictures
