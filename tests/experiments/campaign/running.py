"""A campaign as the command line runs it, for the tests of what reads its folder."""

from chainslam.experiments.campaign.comparison.tables import write_tables
from chainslam.experiments.campaign.plan import trials
from chainslam.experiments.campaign.runner import on_cores, run_campaign
from chainslam.experiments.campaign.store import opened


def run(folder, campaign, jobs=1):
    """Run or resume a campaign in a folder, write its tables, and return the folder."""
    with opened(folder, campaign) as store:
        run_campaign(store, on_cores(jobs))
        write_tables(store.folder, store.campaign, trials(store.campaign), store.record)
    return folder
