# For people: `make run` and `make test`. Each installs what it needs first (on Debian; elsewhere it says what
# is missing), so either works alone on a machine that has only Rust. Every check: .ci/run

.PHONY: run test

osteotome := cargo run --quiet --release --locked -p app --
demo := osteotome-demo

# The window on the built-in case; where there is no display, pictures of that case.
run:
	@.ci/setup run
	@cargo build --release --locked -p app
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] || [ "$$(uname -s)" = Darwin ]; then \
	    exec $(osteotome); \
	fi; \
	set -e; \
	export XDG_RUNTIME_DIR=$${XDG_RUNTIME_DIR:-$$(mktemp -d)}; \
	$(osteotome) demo $(demo); \
	$(osteotome) render $(demo)/case.json --out $(demo)/picture.png --size 768x768; \
	OSTEOTOME_SCREENSHOT=$(demo)/window.png \
	    xvfb-run -a -s "-screen 0 1600x1000x24" $(osteotome) $(demo)/case.json; \
	echo "There is no display here, so the built-in case was drawn into files:"; \
	ls "$$PWD/$(demo)"/*.png

test:
	@.ci/setup test
	cargo test --workspace --locked
	@.ci/ranks
