"""`usm report`: a page that is complete in itself, and works in a browser."""

import base64
import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.browser import drawn, faults, find, show
from usm_baselines.paper.reproduction import PAPER, ReproductionResult, declaration

import usm_gym
from usm_cli.program import main
from usm_cli.report import chapters, page, plots
from usm_cli.report.replay import packed
from usm_gym.rendering import look
from usm_gym.support.provenance import provenance
from usm_gym.support.results import Provenance

ROOT = Path(__file__).parents[2]
SHORT = dataclasses.replace(usm_gym.suite("operation")[1], duration=2.0, settle_time=0.5)
SHORT = dataclasses.replace(
    SHORT, inspection=dataclasses.replace(SHORT.inspection, times=(0.8,), deflections=(0.9,))
)
POLICIES = ("sta", "pd", "oracle")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An evaluation of three short episodes, as a page."""
    made = tmp_path_factory.mktemp("report")
    suite = made / "short.json"
    suite.write_text(json.dumps({"scenarios": [SHORT.to_dict()] * 3}))
    options = ["--policies", ",".join(POLICIES), "--suite", str(suite)]
    main(["evaluate", *options, "--output", str(made / "result.json")])
    main(["report", str(made / "result.json"), "--output", str(made / "page.html")])
    return made


@pytest.fixture(scope="module")
def varied(folder):
    """Robustness curves, as a page."""
    options = ["--policies", "sta,pd", "--suite", str(folder / "short.json")]
    options += ["--vary", "noise", "--values", "0,0.1", "--output", str(folder / "robustness")]
    main(["robustness", *options])
    path = folder / "varied.html"
    main(["report", str(folder / "robustness" / "noise.json"), "--output", str(path)])
    return path


def command(arguments, capsys):
    """The status and the errors of a command."""
    with pytest.raises(SystemExit) as left:
        main([str(each) for each in arguments])
    return left.value.code, capsys.readouterr().err


def test_a_page_needs_nothing_but_itself(folder):
    text = (folder / "page.html").read_text()
    assert not re.search(r"(src|href)=.(?!#|data:)", text)
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest", text)
    assert all(f"<option>{name}" in text or f"selected>{name}" in text for name in POLICIES)
    assert "Not as in the result" not in text
    assert len(list(folder.glob("page*"))) == 1


def test_the_colours_are_those_of_the_films():
    style = page.ASSETS.joinpath("page/page.css").read_text()
    light = style[: style.index("@media")]
    names = ("INK", "BODY", "BODY_EDGE", "HEAD", "HEAD_EDGE", "TAIL", "JET", "JET_CORE")
    for name in (*names, "CURRENT", "REFERENCE"):
        colour = "#{:02x}{:02x}{:02x}".format(*getattr(look, name))
        assert f"--{name.lower().replace('_', '-')}: {colour};" in light, name


def test_packing_keeps_sixteen_bits():
    values = np.random.default_rng(0).normal(size=(50, 3))
    found = packed(values)
    whole = np.frombuffer(base64.b64decode(found["data"]), "<i2").reshape(found["shape"])
    np.testing.assert_allclose(found["scale"] * whole, values, atol=0.5001 * found["scale"])
    assert packed(np.zeros((2, 0)))["shape"] == [2, 0]


def test_a_replay_that_differs_from_its_result_says_so(folder, tmp_path):
    result = json.loads((folder / "result.json").read_text())
    result["results"]["pd"]["per_episode"]["max_error_x"][1] *= 1.01
    (tmp_path / "result.json").write_text(json.dumps(result))
    text = []
    for index in (0, 1):
        options = ["--scenario", str(index), "--output", str(tmp_path / "page.html")]
        main(["report", str(tmp_path / "result.json"), *options])
        text.append((tmp_path / "page.html").read_text())
    assert "Not as in the result" not in text[0]
    assert re.search(r"Not as in the result, [^:]*: pd\.", text[1])


def test_code_that_a_file_names_is_not_run(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("hidden.py").write_text("raise SystemExit('run')")
    result = json.loads((folder / "result.json").read_text())
    result["results"]["hidden:Controller"] = result["results"].pop("pd")
    Path("result.json").write_text(json.dumps(result))
    main(["report", "result.json", "--output", "page.html"])
    assert "hidden:Controller is not replayed" in Path("page.html").read_text()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "No such file: "),
        ("nothing", "is no JSON"),
        ("[1]", "kind of result.json is None; allowed: evaluation, leaderboard"),
        ('{"kind": "poem"}', "kind of result.json is 'poem'; allowed"),
        (
            '{"kind": "evaluation", "suite": null}',
            "result.json is no complete evaluation: conditions is missing",
        ),
    ],
)
def test_what_is_no_result_gets_one_line(tmp_path, monkeypatch, capsys, content, message):
    monkeypatch.chdir(tmp_path)
    if content:
        Path("result.json").write_text(content)
    status, said = command(["report", "result.json", "--output", "page.html"], capsys)
    assert status == 2
    assert message in said
    assert said.count("\n") == 1
    assert not Path("page.html").exists()


def test_wrong_options_get_one_line(folder, capsys, monkeypatch):
    result = folder / "result.json"
    for options, message in (
        (["--output", folder / "missing" / "page.html"], "there is no directory"),
        (["--output", folder / "no.html", "--scenario", 3], "--scenario is 3; allowed: 0 to 2"),
        (["--output", folder / "no.html", "--policies", "nobody"], "policy is 'nobody'"),
    ):
        status, said = command(["report", result, *options], capsys)
        assert (status, said.count("\n")) == (2, 1)
        assert message in said
    monkeypatch.setattr("usm_cli.options.find_spec", lambda name: None)
    _, said = command(["report", result, "--output", folder / "no.html"], capsys)
    assert "pip install 'usm-gym[report]'" in said
    assert not (folder / "no.html").exists()


def test_a_result_gives_the_report_nothing_to_open_or_to_run(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    secret = tmp_path / "token.json"
    secret.write_text('{"token": "s3cret"}')
    agent = tmp_path / "agent"
    agent.mkdir()
    (agent / "agent.json").symlink_to(secret)
    (tmp_path / "evil.py").write_text("raise SystemExit('s3cret')")
    result = json.loads((folder / "result.json").read_text())
    row = result["results"]["sta"]
    for name in (f"sta@{secret}", str(agent), str(secret), "evil:Code", "x" * 10**5, "pd"):
        result["results"][name] = row
    Path("result.json").write_text(json.dumps(result))
    main(["report", "result.json", "--output", "page.html"])
    text = Path("page.html").read_text()
    assert "s3cret" not in text + capsys.readouterr().err
    assert "only registered policies are replayed" in text
    status, said = command(
        ["report", "result.json", "--policies", f"sta@{secret}", "--output", "no.html"], capsys
    )
    assert status == 2
    assert "s3cret" not in said


def test_the_whole_leaderboard_is_a_page(tmp_path):
    (file,) = ROOT.glob("results/*/leaderboard.json")
    main(["report", str(file), "--policies", "zero", "--output", str(tmp_path / "page.html")])
    text = (tmp_path / "page.html").read_text()
    for suite, rows in json.loads(file.read_text())["suites"].items():
        assert f'data-choice="{suite}"' in text
        assert all(f'data-name="{name}"' in text for name in rows)
    assert "Not as in the result" not in text


def test_who_is_beaten():
    corner, dear, both = ({"x": x, "y": y} for x, y in ((1.0, 1.0), (2.0, 0.5), (2.0, 1.0)))
    points = [corner, dear, both]
    assert [plots.beaten(each, points) for each in points] == [False, False, True]


def test_a_reproduction_has_a_page():
    result = ReproductionResult(
        step=2e-4,
        settle_time=5.0,
        rows=PAPER,
        thrust_effort={},
        peak_joint_torque={},
        paper=PAPER,
        scenario=declaration(),
        provenance=Provenance.here({}),
    )
    done = []
    choice = chapters.Choice()
    made = chapters.chapter(result, choice, lambda *numbers: done.append(numbers))
    assert done[-1] == (6, 6)
    replay = made.blocks[1]
    assert set(replay.data["episodes"]) >= {"sta", "pd"}
    assert "ratio 1.00" in page.html([made], provenance({}))


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_a_page_is_readable(browser, folder, varied, width, scheme):
    for path in (folder / "page.html", varied):
        show(browser, path, width, scheme)
        assert faults(browser) == []


@pytest.mark.slow
def test_a_replay_obeys_slider_picker_and_button(browser, folder):
    show(browser, folder / "page.html")
    slider, clock = find(browser, ".time"), find(browser, ".clock")
    scene = drawn(browser, ".scene")
    slider.send_keys("\ue011")  # home
    assert clock.text == "0.00 s"
    assert slider.get_attribute("aria-valuetext") == "0.00 s"
    assert drawn(browser, ".scene") != scene
    slider.send_keys("\ue010")  # end
    assert clock.text == "2.00 s"
    end = drawn(browser, ".scene"), drawn(browser, ".lens")
    picker = find(browser, ".pick-a")
    assert find(browser, ".now .a th").text == picker.get_attribute("value") == "sta"
    picker.send_keys("pd")
    assert find(browser, ".now .a th").text == "pd"
    assert drawn(browser, ".scene") != end[0]
    assert drawn(browser, ".lens") != end[1]
    errors = json.loads((folder / "result.json").read_text())["results"]["pd"]["per_episode"]
    shown = browser.execute_script(
        "return [1, 2].map((axis) => Math.max(...replays[0].a.error"
        ".filter((_, k) => replays[0].sampleTime(k) > 0.499).map((e) => Math.abs(e[axis - 1]))))"
    )
    expected = [errors[f"max_error_{axis}"][0] for axis in "xy"]
    np.testing.assert_allclose(shown, expected, rtol=1e-3)
    slider.send_keys("\ue011")
    find(browser, ".play").send_keys(" ")
    browser.execute_async_script(
        "const [end] = arguments;"
        "const wait = () => replays[0].playing ? requestAnimationFrame(wait) : end(); wait()"
    )
    assert clock.text == "2.00 s"
    texts = "const play = replays[0].find('.play'); return [0, 1].map(() => "
    found = browser.execute_script(texts + "{ play.click(); return play.textContent; })")
    assert found == ["Pause", "Play"]
    assert clock.text == "0.00 s"
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_plots_zoom_and_tell_by_keys(browser, folder, varied):
    show(browser, folder / "page.html")
    limits = "const {min, max} = replays[0].charts[0].scales.x; return max - min"
    whole = browser.execute_script(limits)
    chart = find(browser, ".charts .chart")
    before = find(browser, ".tools .readout").text
    chart.send_keys("\ue014\ue014")  # right
    assert find(browser, ".tools .readout").text != before
    chart.send_keys("+")
    for k in range(3):  # the curves over time share their axis
        assert browser.execute_script(limits.replace("[0].s", f"[{k}].s")) == pytest.approx(
            whole / 2
        )
    chart.send_keys("0")
    assert browser.execute_script(limits) == pytest.approx(whole)
    find(browser, ".tools .zoom button").send_keys("\ue007")  # enter
    assert browser.execute_script(limits) == pytest.approx(whole / 2)
    find(browser, ".panels .chart").send_keys("\ue014")
    assert re.fullmatch(r"\S+: \S+ N/s, \S+ mm", find(browser, ".panels .readout").text)
    show(browser, varied)
    find(browser, ".panels .chart").send_keys("\ue014")
    assert {"sta", "pd"} < set(find(browser, ".panels .readout").text.split())
    find(browser, ".legend input").send_keys(" ")
    find(browser, ".panels .chart").send_keys("\ue014")
    assert "sta" not in find(browser, ".panels .readout").text
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_tables_sort_both_ways_by_keys(browser, folder):
    show(browser, folder / "page.html")
    for column, selector in ((2, "tbody td:nth-child(3)"), (0, "tbody th")):
        head = f".scroll:has(.beats) thead th:nth-child({column + 1})"
        found = []
        for order in ("ascending", "descending"):
            find(browser, f"{head} button").send_keys("\ue007")
            assert find(browser, head).get_attribute("aria-sort") == order
            cells = find(browser, ".scroll:has(.beats)").find_elements("css selector", selector)
            found.append([float(each.get_attribute("data-value")) for each in cells])
        assert found[0] == sorted(found[0]) == found[1][::-1]
        assert len(set(found[0])) == len(POLICIES)
