"""The gains that are shipped."""

from usm_baselines import gains, registry

from usm_gym.suites import suite


def test_shipped_gains_can_be_made() -> None:
    nominal = suite("operation")[0].nominal
    files = [*gains.TUNED.glob("*.json"), *gains.FRONT.glob("*.json")]
    budgets = set()
    for file in files:
        found = gains.read_gains(file)
        budgets.add(found.budget)
        registry.make(found.policy, nominal, **found.gains)
    assert len(budgets) <= 1  # the same for every policy
