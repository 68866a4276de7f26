PYTHON ?= python3
BIN := .venv/bin
PLANS ?= ../shared/data/plans
ROWS := studies/results/rows
PLAYED := block-ekf full-ekf invariant-ekf graph

export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: setup fuzz leaderboard demo test test-long mutants check bench docs smoke compare random courts schools strategies adaptive bias heading weights

# What tests, checks and pages need, too; users of the program need .venv/made only.
setup: .venv/tools

.venv/made: requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps -e .
	$(BIN)/python -m chainslam.experiments.commands.compile_kernels && touch $@

.venv/tools: .venv/made requirements-dev.lock
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements-dev.lock && touch $@

demo: .venv/made
	$(BIN)/chainslam explore paper-fig9 --seed 1

test: setup
	$(BIN)/python -m pytest -n 2 --quiet -m "not long" tests

# What takes minutes or needs a browser (Debian: `apt-get install chromium`).
test-long: setup
	$(BIN)/python -m pytest -n 2 --quiet -m long $(if $(MINUTES),-rs --minutes $(MINUTES)) tests

# How many of the small faults put into the modules of tests/mutants.toml do their own tests notice? MODULE=... for one.
mutants: setup
	$(BIN)/python tests/mutants.py $(MODULE)

.PHONY: plans

# Do all the plans and pictures of a folder load? PLANS=...
plans: setup
	$(BIN)/python -m studies.exploration.plans $(dir $(PLANS))

.PHONY: kills

# Kills runs and campaigns at random moments, lets them go on, and holds what they leave against undisturbed ones.
kills: setup
	$(BIN)/python -m studies.kills

.PHONY: lowest pythons sizes

INSTALLED := results/installed
UV := $(INSTALLED)/uv/bin/uv
PYTHONS ?= python3.11 python3.12 python3.13 python3.14
FOR_TESTS := 'pytest>=8' 'hypothesis>=6.100' 'pandas>=2.2' beartype==0.20 'resvg-py>=0.5'
SMOKE := -o addopts='--import-mode=importlib -p no:cacheprovider' -o filterwarnings=ignore --quiet tests/library/test_interface.py \
    tests/sim/logs tests/sim/worlds tests/slam/backends tests/experiments/commands/test_parsing.py

$(UV):
	$(PYTHON) -m venv $(INSTALLED)/uv && $(INSTALLED)/uv/bin/pip install --quiet --disable-pip-version-check uv

# Does it run with the lowest versions that pyproject.toml allows?
lowest: $(UV)
	$(UV) venv --quiet --clear --python $(PYTHON) $(INSTALLED)/lowest
	$(UV) pip install --quiet --python $(INSTALLED)/lowest --resolution lowest-direct --only-binary :all: -e '.[all]' $(FOR_TESTS)
	$(INSTALLED)/lowest/bin/python -m pytest $(SMOKE)

# Does it run with each Python that is found here?
pythons: $(UV)
	for python in $(PYTHONS); do $$python --version 2>/dev/null || { echo "$$python: none here"; continue; }; \
	    $(UV) venv --quiet --clear --python $$python $(INSTALLED)/$$python && \
	    $(UV) pip install --quiet --python $(INSTALLED)/$$python --only-binary :all: -e '.[all]' $(FOR_TESTS) && \
	    $(INSTALLED)/$$python/bin/python -m pytest $(SMOKE) || exit; done

# What an installation takes on disk, without extras and with each, MB.
sizes: $(UV)
	for extra in none campaign ros view all gym; do $(UV) venv --quiet --clear --python $(PYTHON) $(INSTALLED)/size && \
	    $(UV) pip install --quiet --python $(INSTALLED)/size --compile-bytecode --link-mode copy -e ".[$$(echo $$extra | sed s/none//)]" && \
	    echo $$extra: $$(du -sm $(INSTALLED)/size | cut -f1) || exit; done

check: setup
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# 10,000 mutated inputs through every reader; those that are not borne are kept in results/fuzzing. Then 100 of each kind that others brought.
fuzz: setup
	$(BIN)/python -m tests.fuzzing --count 10000 --seed 1
	$(BIN)/python -m tests.kinds --count 100 --seed 1

bench: setup
	$(BIN)/python -m pytest benchmarks --benchmark-only

# Five back ends on the benchmark; its rows are added to the stored ones. Hours; begun again, it goes on where it was.
leaderboard: setup
	nice $(BIN)/chainslam benchmark --backend block-ekf full-ekf invariant-ekf graph intersection-ekf --out results/leaderboard
	$(BIN)/python -m studies.runner.leaderboard results/leaderboard/rows.jsonl

random: setup
	$(BIN)/python -m studies.exploration.random_buildings --buildings 1000 --out results/random.jsonl

.PHONY: rivals rows apartments apartments-errorless exact schools-whole bundled paper-method navigation-apartments odometry-twice

# What the tables of docs/contributing/results.md are made of, table by table, and then the pages. Hours; begun again, it goes on where it was.
rows: intervals paper rivals paper-method bundled apartments real-plans schools schools-whole courts navigation-apartments results

# 160 apartments with noise, by two back ends.
apartments: setup
	for backend in invariant-ekf graph; do $(BIN)/python -m studies.exploration.suite --plans $(PLANS) --named 'lifull_*' \
	    --backend $$backend --out $(ROWS)/apartments.jsonl || exit; done

# The same without noise, by the full EKF: what is not mapped is not for want of a sure estimate.
apartments-errorless: setup
	$(BIN)/python -m studies.exploration.suite --plans $(PLANS) --named 'lifull_*' --errorless \
	    --out $(ROWS)/in_text/apartments-errorless.jsonl

# What the mapper errs by where nothing is wrong with its input, and where that begins.
exact: setup
	$(BIN)/python -m studies.results.exact --plans $(PLANS) --out $(ROWS)/in_text/exact.jsonl --worlds paper-fig4 paper-fig5 \
	    paper-fig8 paper-fig9 rooms hall $(addprefix $(PLANS)/../rasters/,nav2_depot.yaml nav2_tb3_sandbox.yaml stage_cave.png \
	    stage_hospital_section.png willow-2010-0.10.yaml)

# 39 schools and offices, 1,500 noisy steps each: every back end with one seed, and three of them with a second.
schools: setup
	$(BIN)/python -m studies.exploration.schools --plans $(PLANS) --jobs 2 --out $(ROWS)/schools.jsonl
	$(BIN)/python -m studies.exploration.schools --plans $(PLANS) --jobs 2 --out $(ROWS)/schools.jsonl \
	    --backends full-ekf invariant-ekf graph --seeds 1 2

# Every back end on the same drives of figures 8 and 9, of two rings and of 40 apartments; begun again, it goes on where it was.
rivals: setup
	nice $(BIN)/python -m studies.paper.rivals --seeds 20 --out $(ROWS)/rivals.jsonl
	nice $(BIN)/python -m studies.paper.rivals --plans $(PLANS) --driver invariant-ekf --out $(ROWS)/rivals.jsonl


# The same buildings, to their end.
schools-whole: setup
	$(BIN)/python -m studies.exploration.suite --plans $(PLANS) --named 'cml_*' --backend invariant-ekf --max-steps 30000 \
	    --out $(ROWS)/schools-whole.jsonl

# 500 m in five of them by wheels that slip twice as much, and are stated so.
odometry-twice: setup
	for backend in invariant-ekf graph; do $(BIN)/python -m studies.exploration.suite --plans $(PLANS) --named 'cml_[ab]*' \
	    --backend $$backend --slip 2 --max-path-m 500 --out $(ROWS)/in_text/odometry-twice.jsonl || exit; done

bundled: setup
	$(BIN)/python -m studies.exploration.suite --errorless --out $(ROWS)/bundled-errorless.jsonl
	$(BIN)/python -m studies.exploration.suite --seeds 10 --out $(ROWS)/bundled-noisy.jsonl

# A duplicate wall by the paper's own method.
paper-method: setup
	$(BIN)/python -m studies.consistency.paper_method --max-steps 200 --out $(ROWS)/paper-method.jsonl

bias: setup
	$(BIN)/python -m studies.consistency.bias --strategies nearest-robot nearest-start --out results/bias.jsonl
	$(BIN)/python -m studies.consistency.bias --association own --out results/bias-own.jsonl

# 300 runs, about an hour of one core; begun again, it goes on where it was. --length-m 30 60 120 --heading-deg 1 4 takes a night.
heading: setup
	$(BIN)/python -m studies.consistency.heading --out results/heading.jsonl --picture results/heading.png

# 600 runs, about two hours of one core; begun again, it goes on where it was.
adaptive: setup
	$(BIN)/python -m studies.exploration.adaptive --out results/adaptive.jsonl

.PHONY: robots scanners bodies bumps logs scanner-apartments

# Every fault of a robot in one world; begun again, it goes on where it was. `make results` makes its tables.
robots: setup
	$(BIN)/python -m studies.robots.faults

# Turns of 8 degrees that the wheels do not report; begun again, it goes on where it was.
bumps: setup
	$(BIN)/python -m studies.robots.bumps --seeds 5

# Other bodies, and scanners off the axle; begun again, it goes on where it was.
bodies: setup
	$(BIN)/python -m studies.robots.bodies --plans $(PLANS)

# Forty apartments with 541 beams over 270 degrees, 10 m; begun again, it goes on where it was.
scanner-apartments: setup
	$(BIN)/python -m studies.robots.apartments --plans $(PLANS)

# Logs of real robots, each by offline refinement alone and through several back ends; begun again, it goes on where it was.
logs: setup
	$(BIN)/python -m studies.logs.refined --logs $(or $(LOGS),../shared/data/logs)
	$(BIN)/python -m studies.logs.study --logs $(or $(LOGS),../shared/data/logs)

# Other scanners and their faults, in one world; begun again, it goes on where it was.
scanners: setup
	$(BIN)/python -m studies.robots.scanners --seeds 5

courts: setup
	$(BIN)/python -m studies.exploration.courts --out $(ROWS)/courts.jsonl

strategies: setup
	$(BIN)/python -m studies.exploration.strategies --seeds 20 --out results/strategies.jsonl

# Both navigations in the bundled worlds and in 160 apartments; begun again, it goes on where it was.
navigation: setup
	$(BIN)/python -m studies.exploration.navigation --plans $(PLANS) --out results/navigation.jsonl

.PHONY: navigation paper study intervals real-plans existence interval-causes counts settings

# The same in every eighth apartment, errorless.
navigation-apartments: setup
	$(BIN)/python -m studies.exploration.navigation --worlds --plans $(PLANS) --every 8 --jobs 2 --out $(ROWS)/navigation.jsonl

# The paper's figures over 20 seeds, stored with the commit; begun again, it goes on where it was. `make results` makes their tables.
paper: setup
	$(BIN)/python -m studies.paper.following --jobs 2
	$(BIN)/python -m studies.paper.study --seeds 20

# Campaign, bias, heading, strategies, intervals, the paper's figures, and one report; hours, goes on where it was. TRIALS=...
study: setup
	$(BIN)/python -m studies.whole --trials $(or $(TRIALS),20) --out results/study

.PHONY: dimensions

# Do the intervals of a plan's dimensions hold the true ones, and are walls found that stand elsewhere than drawn? 40 apartments.
dimensions: setup
	$(BIN)/python -m studies.plans.dimensions --plans $(PLANS) --runs results/plans
	$(BIN)/python -m studies.plans.as_built --plans $(PLANS) --runs results/plans

.PHONY: uneven

# Do maps hold where walls have steps, bends and pilasters of 10 to 60 mm? 12 apartments made so; begun again, it goes on where it was.
uneven: setup
	$(BIN)/python -m studies.plans.uneven --plans $(PLANS)

.PHONY: structure

# Are walls taken for square, collinear or equally thick that are not, and what do sure relations do to a map? 12 apartments, as drawn and askew.
structure: setup
	$(BIN)/python -m studies.plans.structure --plans $(PLANS) --count 12 --runs results

.PHONY: sessions

# Does a second session find its place in the map of the first, and is the map of both consistent? 40 apartments.
sessions: setup
	$(BIN)/python -m studies.plans.sessions --plans $(PLANS) --runs results/plans

# Of 100 runs, how many of the 95 % intervals between corners hold the truth, run by run?
intervals: setup
	$(BIN)/python -m studies.consistency.intervals --seeds 100 --out $(ROWS)/intervals.jsonl

# The paper's question in real plans: every fourth apartment, explored once and replayed through every back end. The stored rows
# are of six back ends, and of all by their own matches in five apartments (`--every 32 --stages own`).
real-plans: setup
	$(BIN)/python -m studies.consistency.real_plans --plans $(PLANS) --out $(ROWS)/real-plans.jsonl

# How many segments lie over two faces, and which lines do looks show? What `mission.mapper.walls.existence` rests on.
existence: setup
	$(BIN)/python -m studies.consistency.existence --plans $(PLANS)

# Is it the matches, or the lines, that make them fail more often in one run than in another?
interval-causes: setup
	$(BIN)/python -m studies.consistency.interval_causes --seeds 60

# How large the code is where size hurts: numbers that one may tune, entries of a folder, imports.
counts: setup
	$(BIN)/python -m studies.code.counts

# The page of all settings, from the docstrings beside them.
settings: setup
	PYTHONPATH=. $(BIN)/python docs/_ext/settings_page.py > docs/reference/settings.md

# What gets worse without each mechanism, in 40 apartments, 13 uneven ones and ten schools, and its page. Hours; begun again, it goes on where it was.
weights: setup
	for plans in apartments uneven schools; do nice $(BIN)/python -m studies.weights.run --plans $(PLANS) --set $$plans || exit; done
	$(BIN)/python -m studies.weights.table

.PHONY: pictures alike results screenshots player

# The films that the site's first page plays, from runs made now.
player: setup
	for world in paper-fig9 tests/data/plans/apartment.json random:1; do name=$$(basename $$world .json | tr : -); out=results/player/$$name; \
	    $(BIN)/chainslam explore $$world --seed 1 --out $$out/drive --force && \
	    $(BIN)/chainslam replay $$out/drive/log.npz --backend $(PLAYED) --out $$out/runs --force && \
	    $(BIN)/python -m chainslam.experiments.views.player $(PLAYED:%=$$out/runs/%) --out docs/films/$$name.json || exit; done

# Does this code drive as version THAN of it, to the last bit? Then rows of that version count as rows of this one.
alike: setup
	$(BIN)/python -m studies.runner.alike --than $(THAN) --plans $(PLANS)

# The tables of docs/benchmarks.md and docs/contributing from stored rows; says which rows are of another version of the code.
results: setup
	$(BIN)/python -m studies.results.page

# The site, in docs/_build/index.html: it needs no network, and every warning is an error.
docs: setup
	$(BIN)/sphinx-build -q -W --keep-going docs docs/_build

# Every page and report as a browser shows it, for a screen and for a phone; needs Chromium.
screenshots: setup
	docs/make-screenshots

# Every picture of the documentation, from runs made now.
pictures: setup
	docs/make-pictures

smoke: .venv/made
	$(BIN)/chainslam compare --preset smoke --out results/smoke
	$(BIN)/chainslam report results/smoke

compare: .venv/made
	$(BIN)/chainslam compare --preset paper --out results/paper
	$(BIN)/chainslam report results/paper --latex
