"""Results as one page of HTML, complete in itself (needs the extra `report`).

`chapters` says what a kind of result shows, in the blocks of `blocks`; `replay` computes episodes
anew; `page` puts it all into the templates.
"""
