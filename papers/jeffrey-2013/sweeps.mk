# The paper's long sweeps, for the Makefile at the top: starts, readings and numbers of runs. What is
# there already is kept if six of its rows come out the same again.
.PHONY: census capture
JEFFREY := papers/jeffrey-2013/code

# The sweeps behind code/census, code/audit and code/basin: 300 starts within 1e-9 of the paper's; fig. 7(iii) by other methods and
# tolerances, and to shorter times with small local errors; alpha and beta over three decades each, and one exponent changed; starts on a plane.
SWEEP := $(RUN) --bin twofold -- sweep --threads $(or $(THREADS),0) --resume --recheck 6
STARTS := --over shift.x=-5e-10..5e-10 --over shift.y=-5e-10..5e-10 --over shift.z=-5e-10..5e-10
READINGS := --over params.alpha=1e-3,0.1
PRINTED := --over params.alpha=1e-3
RECONSTRUCTED := --over params.alpha=0.1
INTERVALS := --over interval=20,40,100
HYSTERETIC := --restart 100 --switch hysteretic
SIGMAS := --restart 100 --over sigma=0.01,0.1,0.13
METHODS := --over method=dopri5,radau5 --t-end 2e5 --restart 100
TOLERANCES := --over tolerance=1e-6,1e-8,1e-10,1e-12 --t-end 2e5 --restart 100 --method dopri5
TIGHT := --t-end 2e5 --restart 100 --method dopri5 --over tolerance=1e-13
TAYLOR := --restart 100 --method taylor --rtol 1e-15 --atol 1e-15
EXTENDED := --restart 100 --method taylor-extended --rtol 1e-20 --atol 1e-20
CELLS := --over params.alpha=1e-3..1:log:7 --over params.beta=1e-6..1e-3:log:7
ALPHA := --over params.alpha=1e-2,1 --over params.beta=1e-5
ALPHAS := --over params.alpha=1e-3,1e-2,0.1,1 --over params.beta=1e-5
BETA := --over params.alpha=1e-3 --over params.beta=1e-6,1e-4,1e-3
C := $(JEFFREY)/census
A := $(JEFFREY)/audit
census: ## go on with the census, the audit and the basins (hours; Ctrl-C keeps what is finished, and the next call goes on)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) --t-end 1e4 --method dopri5 --over start.x=-60..60:25 --over start.y=0 --over start.z=-60..60:25 --out $(JEFFREY)/basin/printed.csv
	@$(SWEEP) --t-end 1e4 --method dopri5 --reading reconstructed --over start.x=-3..3:25 --over start.y=0 --over start.z=-3..3:25 --out $(JEFFREY)/basin/reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(READINGS) $(INTERVALS) $(STARTS) --random 300 --out $(C)/fig7.csv
	@$(SWEEP) --t-end 2e5 --system $(JEFFREY)/control/shifted.toml $(INTERVALS) $(STARTS) --random 30 --out $(JEFFREY)/control/shifted.csv
	@$(SWEEP) --t-end 2e5 --reading reconstructed --eps 0.1 $(INTERVALS) $(STARTS) --random 30 --out $(JEFFREY)/control/wide.csv
	@$(SWEEP) --t-end 2e5 $(READINGS) $(SIGMAS) $(STARTS) --random 300 --out $(C)/fig8.csv
	@$(SWEEP) $(PRINTED) $(METHODS) $(STARTS) --random 100 --out $(C)/methods-printed.csv
	@$(SWEEP) $(RECONSTRUCTED) $(METHODS) $(STARTS) --random 24 --out $(C)/methods.csv
	@$(SWEEP) $(PRINTED) $(TOLERANCES) $(STARTS) --random 28 --out $(C)/tolerances-printed.csv
	@$(SWEEP) $(RECONSTRUCTED) $(TOLERANCES) $(STARTS) --random 21 --out $(C)/tolerances.csv
	@$(SWEEP) $(TIGHT) $(PRINTED) $(STARTS) --random 30 --out $(C)/tight-printed.csv
	@$(SWEEP) $(TIGHT) $(RECONSTRUCTED) $(STARTS) --random 12 --out $(C)/tight.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) --restart 100 $(STARTS) --random 100 --out $(C)/ordinary-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) --restart 100 $(STARTS) --random 100 --out $(C)/ordinary-reconstructed.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) $(TAYLOR) $(STARTS) --random 100 --out $(C)/taylor-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) $(TAYLOR) $(STARTS) --random 100 --out $(C)/taylor-reconstructed.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) $(EXTENDED) $(STARTS) --random 12 --out $(C)/extended-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) $(EXTENDED) $(STARTS) --random 6 --out $(C)/extended-reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(ALPHA) $(INTERVALS) $(STARTS) --random 30 --out $(A)/alpha7.csv
	@$(SWEEP) --t-end 2e5 $(ALPHA) $(SIGMAS) $(STARTS) --random 30 --out $(A)/alpha8.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(INTERVALS) $(STARTS) --random 30 --out $(A)/beta7.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(SIGMAS) $(STARTS) --random 30 --out $(A)/beta8.csv
	@$(SWEEP) --t-end 2e5 $(ALPHAS) $(HYSTERETIC) $(STARTS) --random 12 --out $(A)/alpha9.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(HYSTERETIC) $(STARTS) --random 12 --out $(A)/beta9.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(CELLS) $(INTERVALS) $(STARTS) --random 6 --out $(A)/fig7.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(CELLS) $(SIGMAS) $(STARTS) --random 6 --out $(A)/fig8.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(HYSTERETIC) $(CELLS) $(STARTS) --random 2 --out $(A)/fig9.csv

# The sweeps behind code/capture, by the rules that stand there.
K := $(JEFFREY)/capture
CAPTURE := --t-end 2e5 --restart 100 --random-seed
PANEL30 := --t-end 2e5 --over params.alpha=0.1 --over params.beta=3.16227766016838e-4
capture: ## go on with the study of the times of capture, the map of the parameters by LSODA and the candidates' runs (an hour and a half on one core)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) $(PANEL30) $(INTERVALS) $(STARTS) --random 30 --out $(K)/best7.csv
	@$(SWEEP) $(PANEL30) $(SIGMAS) $(STARTS) --random 30 --out $(K)/best8.csv
	@$(SWEEP) $(PANEL30) $(HYSTERETIC) $(STARTS) --random 12 --out $(K)/best9.csv
	@$(SWEEP) $(CAPTURE) 2014 --method dopri5 $(PRINTED) $(STARTS) --random 200 --out $(K)/dopri5-printed.csv
	@$(SWEEP) $(CAPTURE) 2015 --method radau5 $(PRINTED) $(STARTS) --random 200 --out $(K)/radau5-printed.csv
	@$(SWEEP) $(CAPTURE) 2016 --method taylor --rtol 1e-15 --atol 1e-15 $(PRINTED) $(STARTS) --random 200 --out $(K)/taylor-printed.csv
	@$(SWEEP) $(CAPTURE) 2014 --method dopri5 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/dopri5-reconstructed.csv
	@$(SWEEP) $(CAPTURE) 2015 --method radau5 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/radau5-reconstructed.csv
	@$(SWEEP) $(CAPTURE) 2016 --method taylor --rtol 1e-15 --atol 1e-15 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/taylor-reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(CELLS) $(INTERVALS) $(STARTS) --random 5 --out $(K)/map7.csv
	@$(SWEEP) --t-end 2e5 $(CELLS) $(SIGMAS) $(STARTS) --random 5 --out $(K)/map8.csv
	@$(RUN) --example visits > $(K)/visits.csv

.PHONY: resolved
D := $(JEFFREY)/resolved
RESOLVED := --t-end 2e5 $(READINGS) $(STARTS) --random 100 --rtol 1e-13 --atol 1e-13 --random-seed
DIGITS := --t-end 2e5 $(STARTS) --over interval=100 --method taylor-extended --rtol 1e-25 --atol 1e-25 --random-seed 2020
resolved: ## the census by methods that resolve the layer, by the rules in papers/jeffrey-2013/code/resolved (three hours on one core; a stopped call goes on)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) $(RESOLVED) 2017 --method taylor $(INTERVALS) --out $(D)/taylor7.csv
	@$(SWEEP) $(RESOLVED) 2018 --method taylor $(SIGMAS) --out $(D)/taylor8.csv
	@$(SWEEP) $(RESOLVED) 2019 --method layered $(INTERVALS) --out $(D)/layered7.csv
	@$(SWEEP) $(DIGITS) $(PRINTED) --random 100 --out $(D)/extended-printed.csv
	@$(SWEEP) $(DIGITS) $(RECONSTRUCTED) --random 60 --out $(D)/extended-reconstructed.csv

.PHONY: delay-data
delay-data: ## the data of papers/jeffrey-2013/code/delay: passages, and a hundred runs of each rule to compare (a quarter of an hour; a stopped call goes on)
	@$(CARGO) build --release --locked --quiet --example delay_growth --example delay_runs
	@target/release/examples/delay_growth growth > target/delay-growth.csv && mv target/delay-growth.csv $(JEFFREY)/delay/growth.csv
	@target/release/examples/delay_growth exits > target/delay-exits.csv && mv target/delay-exits.csv $(JEFFREY)/delay/exits.csv
	@target/release/examples/delay_runs sections > target/delay-sections.csv && mv target/delay-sections.csv $(JEFFREY)/delay/sections.csv
	@target/release/examples/delay_runs > target/delay-runs.csv && mv target/delay-runs.csv $(JEFFREY)/delay/runs.csv
