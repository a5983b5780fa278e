"""Shows results as one self-contained page of HTML (needs the extra `report`).

`chapters` turns a kind of result into the blocks of `blocks`, `replay` computes episodes again, and
`page` fills the templates.
"""
