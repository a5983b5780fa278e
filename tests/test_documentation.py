"""The pages do what they say: every block of code runs, and the site builds."""

import re
import runpy
import shlex
import shutil
import sys
import tomllib
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
import usm_baselines
from markdown_it import MarkdownIt
from support import axe
from support.trainings import brief, shorten
from usm_agents.artifact.folder import PRETRAINED
from usm_agents.learning import training
from usm_baselines.benchmark.leaderboard import Board
from usm_baselines.registry import law_of

import usm_gym
from usm_cli import selection
from usm_cli.program import main

ROOT = Path(__file__).parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]

# Options that are added to a command, by how it begins: the later one counts.
BUDGETS = {
    "usm policies": "",
    "usm evaluate --suite": "--policies zero",
    "usm evaluate --mode head": "--episodes 2",
    "usm evaluate": "--mode operation --episodes 2",
    "usm compare": "--mode operation --episodes 2",
    "usm robustness --mode head": "--episodes 2",
    "usm robustness --vary delay": "--values 1 --episodes 2",
    "usm robustness --vary step": "--values 0.5 --episodes 2",
    "usm robustness": "--values 0.05 --episodes 2",
    "usm tune": "--trials 2 --episodes 2",
    "usm leaderboard": "--policies zero --workers 1",
    "usm watch": "--speed 40",
    "usm train --resume": "",
    "usm train": "--steps 1024",
    "usm study": "--only scale-6 --seeds 1 --steps 1024 --episodes 2",
    "usm report": "--policies zero",
    "usm record": "--episodes 2",
}
SHORTER_PYTHON = {
    'PPO("MlpPolicy", env).learn(5000)': 'PPO("MlpPolicy", env, n_steps=64).learn(64)',
    'usm_gym.suite("operation")': 'usm_gym.suite("operation")[:2]',
}
# What CI does itself, what would change the reader's machine, and what no option makes short.
LEFT_OUT = (
    "python3 -m venv",
    "python -m ",
    "python docs/",
    "source ",
    "git ",
    ".venv/bin/",
    "pip install",
    "pre-commit",
    "pytest",
    "HYPOTHESIS_PROFILE",
    "mkdocs",
    "usm bench",
    "usm reproduce",
)
# The theme's names of the schemes that a reader may prefer.
SCHEMES = {"light": "default", "dark": "slate"}
# Pages of more elements take axe-core long, and are looked at in the first scheme only.
LARGE = 5000
ALIKE = re.compile(r"results/(space|head|head3d)/")


def blocks(page):
    """The blocks of code of a page: language, text, the line before it."""
    before = ""
    for token in MarkdownIt().parse(page.read_text(encoding="utf-8")):
        if token.type in ("fence", "code_block"):
            yield token.info, token.content, before
        before = token.content or before


def budgeted(line):
    """The arguments of a command line, within its budget."""
    name = next((name for name in BUDGETS if line.startswith(name)), None)
    assert name is not None, f"no budget for {line!r}"
    return shlex.split(line, comments=True)[1:] + shlex.split(BUDGETS[name])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the README, results, and the files that the pages tell a reader to save."""
    for page in PAGES:
        for _, text, before in blocks(page):
            if saved := re.match(r"Save this as `(.+)`", before):
                (tmp_path / saved[1]).write_text(text, encoding="utf-8")
    (tmp_path / "README.md").write_bytes((ROOT / "README.md").read_bytes())
    shutil.copytree(ROOT / "results", tmp_path / "results")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    whole = Board.suites

    def few(board):
        return {name: [*map(brief, frozen[:2])] for name, frozen in whole(board).items()}

    monkeypatch.setattr(Board, "suites", few)
    shorten(monkeypatch)
    unseen, suite = selection.unseen, selection.suite
    monkeypatch.setattr(selection, "unseen", lambda *given: [*map(brief, unseen(*given))])
    monkeypatch.setattr(selection, "suite", lambda *given: [*map(brief, suite(*given))])
    trained = partial(training.train, validation_episodes=2, test_episodes=2)
    monkeypatch.setattr(training, "train", trained)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(blocks(page))], ids=lambda p: p.stem
)
def test_every_block_of_a_page_runs(page, folder):
    namespace = {}
    for language, text, _ in blocks(page):
        assert language in ("python", "sh", "text"), language
        if language == "python":
            for long, short in SHORTER_PYTHON.items():
                text = text.replace(long, short)
            exec(compile(text, page.name, "exec"), namespace)
        elif language == "sh":
            for line in re.split(r"\n|&& ", text.replace("\\\n", " ")):
                if line and not line.startswith(LEFT_OUT):
                    main(budgeted(line))


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_what_a_page_names_is_there(page):
    text = page.read_text(encoding="utf-8")
    for name in re.findall(
        r"`((?:agents|baselines|docs|notebooks|tests|usm_cli|usm_gym)/[\w./-]*)`", text
    ):
        assert (ROOT / name).exists(), name
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    for names in re.findall(r"pip install .*\[(.+?)\]'", text):
        assert set(names.split(",")) <= set(extras), names


def test_the_pictures_of_the_pages_are_what_their_command_draws():
    for name, draw in runpy.run_path(str(ROOT / "docs" / "draw.py"))["DRAWINGS"].items():
        assert (ROOT / "docs" / name).read_text(encoding="utf-8") == draw(), name


def test_every_law_has_its_place_among_the_controllers():
    pages = [ROOT / "docs" / name for name in ("controllers.md", "tasks_head.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    shown = {id for ids in re.findall(r"<!-- law: (.+?) -->", text) for id in ids.split(", ")}
    laws = {id for id in usm_baselines.ids() if not (PRETRAINED / id).exists()} - {
        "zero",
        "heading",
    }
    assert set(map(law_of, laws)) == shown


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, whose figures have a short episode."""
    commands = pytest.importorskip("mkdocs.commands.build")
    pages, made = tmp_path_factory.mktemp("pages"), tmp_path_factory.mktemp("site")
    short = [brief(usm_gym.suite("operation")[0])]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(usm_gym, "suite", lambda name: short)
        prepare = runpy.run_path(str(ROOT / "docs" / "prepare"))["prepare"]
        patch.setattr(sys.modules["published"], "report", lambda: b"<!doctype html>")
        prepare(pages)
    config = pytest.importorskip("mkdocs.config").load_config(
        str(ROOT / "mkdocs.yml"), strict=True, docs_dir=str(pages), site_dir=str(made)
    )
    config.plugins.run_event("startup", command="build", dirty=False)
    commands.build(config)
    return made


@pytest.mark.slow
def test_the_site_builds_without_a_warning(site):
    front, model, laws = (
        (site / name / "index.html").read_text(encoding="utf-8")
        for name in ("", "model", "controllers")
    )
    assert "<mtable" in model
    assert laws.count("<svg") > 8
    readme = (ROOT / "README.md").read_text(encoding="utf-8").partition("<details>")[0]
    rows = re.findall(r"\| (`.+?`) \|.+\| ([\d.]+ ± [\d.]+) \|", readme)
    assert len(rows) > 9
    shown = re.findall(r"<td>(<code>.+?</code>)</td>.*?>([\d.]+ ± [\d.]+)</td>", front, re.DOTALL)
    assert shown == [(f"<code>{id.strip('`')}</code>", error) for id, error in rows]


@pytest.fixture(scope="module")
def address(site):
    """Where a server shows the site."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=site)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def shows(scheme):
    """Whether a browser shows a page in a scheme of the theme, as something to wait for."""
    script = f"return document.body.dataset.mdColorScheme === '{scheme}'"
    return lambda browser: browser.execute_script(script)


@pytest.mark.slow
def test_axe_finds_nothing_wrong_with_a_page_of_the_site(site, address, browser):
    from selenium.webdriver.support.wait import WebDriverWait

    found = {}
    pages = {path.relative_to(site).as_posix() for path in site.rglob("*.html")}
    # The report has a test of its own. Tables of other boards are like those of the first.
    others = {"results/report.html", *(page for page in pages if ALIKE.match(page))}
    assert len(others) > 1
    for page in sorted(pages - others):
        browser.get(f"{address}/{page}")
        large = browser.execute_script("return document.querySelectorAll('body *').length") > LARGE
        for scheme, name in list(SCHEMES.items())[: 1 if large else None]:
            media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
            WebDriverWait(browser, 60).until(shows(name))
            found[page, scheme] = axe.violations(browser)
    assert not {at: wrong for at, wrong in found.items() if wrong}
