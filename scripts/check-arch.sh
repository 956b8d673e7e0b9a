#!/bin/sh
# Builds the program for other architectures, runs it there under emulation, and says of each whether every byte is the committed one.
#
#   scripts/check-arch.sh [TARGET...]      (make check-arch; Debian or Ubuntu; wasm32 wants PyPI's package wasmtime)
#
# Targets: aarch64, s390x (big-endian), i686 (32 bits), riscv64, wasm32; these if nothing is said. i686 runs without emulation where the kernel takes it.
# And windows (x86-64): under wine, which is not Windows, and on the processor itself. COMPILER=rustup only, with gcc-mingw-w64-x86-64: Debian's unstable suite has no
# standard library for it. Wine is this machine's if that starts the program, else that of the suite, in the root.
#
# COMPILER=rustup: the project's own compiler, the target's standard library from rustup, a cross linker from Debian (gcc-aarch64-linux-gnu libc6-dev-arm64-cross, ...) and
# qemu-user-static. qemu 7.2 is too old for s390x: it draws wrong pixels (11.1 draws the right ones with the same program).
# COMPILER=debian: another compiler, that of Debian's unstable suite, in a root of its own (ROOT, 5 GB; needs root and debootstrap; `scripts/check-arch.sh clean` removes
# it), with the emulator of that suite. Crates are those of Cargo.lock (cargo vendor). Not said: rustup's where it can build for that target, Debian's where it cannot.
#
# RUN: what is run, "check fig1 fig2 fig3 fig4 fig5 fig6 delay" if nothing is said, and then the exponents of tests/data/late-exponents.txt, too; "check" is all figures
# (hours under emulation). LEVEL: optimisation (1). THREADS (1).
# ONLY=build, ONLY=run: half of it (to run what was built needs a root of 0.5 GB only). MIRROR: Debian's. PYTHON: one that has wasmtime. The results are added to target/arch/report.txt.
set -u
work=${WORK:-$PWD/target/arch}
root=${ROOT:-$work/root}
mirror=${MIRROR:-http://deb.debian.org/debian}
run=${RUN:-check fig1 fig2 fig3 fig4 fig5 fig6 delay}
level=${LEVEL:-1}
threads=${THREADS:-1}
only=${ONLY:-}
here=$(dirname "$0")

# Nothing is ever mounted in the root but for the command that runs there, so that it can be removed like any folder.
inside() {
    # shellcheck disable=SC2016
    unshare --mount sh -c 'mount -t proc proc "$0/proc" && exec chroot "$0" /usr/bin/env -i HOME=/root LC_ALL=C DEBIAN_FRONTEND=noninteractive PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"' "$root" "$@"
}

if [ "${1:-}" = clean ]; then
    if mount | grep -q " on $root/"; then echo "something is mounted in $root: unmount it first"; exit 2; fi
    rm -rf "$root"
    exit
fi
[ $# -gt 0 ] || set -- aarch64 s390x i686 riscv64 wasm32
mkdir -p "$work"

# The bare root.
bare() {
    [ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase sid "$root" "$mirror" > "$work/debootstrap.log" 2>&1 || return 1
    # A mirror may be a picture of some past day.
    echo 'Acquire::Check-Valid-Until "false";' > "$root/etc/apt/apt.conf.d/00mirror"
    mkdir -p "$root/src"
}

# With an emulator and the C libraries of the other machines: what it takes to run what was built before.
emulator() {
    [ ! -e "$root/.emulates" ] || return 0
    bare || return 1
    {
        inside apt-get update && inside apt-get install -y --no-install-recommends qemu-user libc6-arm64-cross libgcc-s1-arm64-cross libc6-s390x-cross libgcc-s1-s390x-cross \
            libc6-riscv64-cross libgcc-s1-riscv64-cross libc6-i386-cross libgcc-s1-i386-cross
    } > "$work/apt.log" 2>&1 || return 1
    touch "$root/.emulates"
}

# With wine, 1.2 GB and what it needs.
with_wine() {
    [ ! -e "$root/.wine" ] || return 0
    bare && { inside apt-get update && inside apt-get install -y --no-install-recommends wine wine64; } > "$work/apt.log" 2>&1 || return 1
    touch "$root/.wine"
}

# And a compiler, cross linkers, and the standard libraries of the other targets. Those packages are unpacked, not installed: what they depend on (the compiler's own
# libraries for that machine) is not needed to build for it.
setup() {
    [ ! -e "$root/.ready" ] || return 0
    emulator || return 1
    for a in arm64 s390x i386 riscv64; do inside dpkg --add-architecture $a; done
    {
        inside apt-get update && inside apt-get install -y --no-install-recommends rustc cargo libstd-rust-dev-wasm32 lld gcc libc6-dev \
            gcc-aarch64-linux-gnu libc6-dev-arm64-cross gcc-s390x-linux-gnu libc6-dev-s390x-cross gcc-riscv64-linux-gnu libc6-dev-riscv64-cross \
            gcc-i686-linux-gnu libc6-dev-i386-cross &&
            mkdir -p "$root/debs" && inside sh -c 'cd /debs && for a in arm64 s390x i386 riscv64; do apt-get download libstd-rust-dev:$a; done' &&
            for deb in "$root"/debs/*.deb; do dpkg-deb -x "$deb" "$root"; done
    } >> "$work/apt.log" 2>&1 || return 1
    rm -rf "$root/debs" "$root"/var/cache/apt/archives/*.deb
    touch "$root/.ready"
}

# The sources as they are committed, and every crate they name.
sources() {
    mkdir -p "$root/src/twofold/.cargo"
    git archive HEAD | tar -x -C "$root/src/twofold" --exclude rust-toolchain.toml || return 1
    rm -f "$root/src/twofold/rust-toolchain.toml"
    cargo vendor --locked --quiet "$root/src/vendor" > /dev/null || return 1
    printf '[source.crates-io]\nreplace-with = "vendored"\n[source.vendored]\ndirectory = "/src/vendor"\n' > "$root/src/twofold/.cargo/config.toml"
}

# Can the project's own compiler build for this target?
by_rustup() {
    command -v rustup > /dev/null && rustup target add "$triple" > /dev/null 2>&1 && { [ -z "$cross" ] || command -v "$cross-gcc" > /dev/null; }
}

# Debian's compiler into $1, or ours.
build() {
    name=$(echo "$triple" | tr 'a-z-' 'A-Z_')
    if [ -n "$cross" ]; then linker=$cross-gcc; else linker=; fi
    if [ "$compiler" = rustup ]; then
        version=$(rustc --version | cut -d ' ' -f 1,2)
        env ${linker:+"CARGO_TARGET_${name}_LINKER=$linker"} CARGO_PROFILE_RELEASE_OPT_LEVEL="$level" CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_LTO=off \
            cargo build --release --locked --quiet --bin twofold --target "$triple" --target-dir "$work/rustup" || return 1
        made=$work/rustup/$triple/release
    else
        setup || { echo "the root could not be made: see $work/*.log"; return 1; }
        [ -n "${sourced:-}" ] || sources || { echo "the crates could not be fetched"; return 1; }
        sourced=yes
        version=$(inside rustc --version | cut -d ' ' -f 1,2)
        inside env "CARGO_TARGET_${name}_LINKER=${linker:-wasm-ld}" CARGO_PROFILE_RELEASE_OPT_LEVEL="$level" CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_LTO=off \
            sh -c "cd /src/twofold && cargo build --release --locked --offline --quiet --bin twofold --target $triple" || return 1
        made=$root/src/twofold/target/$triple/release
    fi
    mkdir -p "$work/$target-$compiler"
    for file in twofold twofold.exe twofold.wasm; do [ ! -e "$made/$file" ] || cp "$made/$file" "$work/$target-$compiler/"; done
    echo "$version, level $level" > "$work/$target-$compiler/compiler"
}

# A program under wine, whose own folder is in the scratch folder. It opens no window and needs no display.
under_wine() {
    export WINEDEBUG=-all WINEDLLOVERRIDES=mscoree,mshtml= WINEPREFIX="$work/wine"
    if wine "$1" --version > /dev/null 2>&1; then
        wine "$@"
    else
        with_wine || { echo "the root could not be made: see $work/*.log" >&2; return 2; }
        cp --remove-destination "$1" "$root/src/twofold.exe"
        shift
        inside env WINEDEBUG=-all WINEDLLOVERRIDES=mscoree,mshtml= WINEPREFIX=/src/wine XDG_RUNTIME_DIR=/tmp wine /src/twofold.exe "$@"
    fi
}

# The program on its own kind of machine. The C library is that of the cross compiler.
on_it() {
    if [ "$target" = windows ]; then
        under_wine "$work/$target-$compiler/twofold.exe" "$@"
        return
    fi
    libraries=/usr/$cross
    if [ "$compiler" != rustup ] && [ "$target" != wasm32 ]; then
        emulator || { echo "the root could not be made: see $work/*.log" >&2; return 2; }
        libraries=$root$libraries
    fi
    program=$work/$target-$compiler/twofold
    if [ "$target" = wasm32 ]; then
        "${PYTHON:-python3}" "$here/wasm.py" "$program.wasm" "$@"
    elif [ "$target" = i686 ] && "$libraries/lib/ld-linux.so.2" --library-path "$libraries/lib" "$program" --version > /dev/null 2>&1; then
        # A kernel that takes programs of 32 bits needs no emulation.
        "$libraries/lib/ld-linux.so.2" --library-path "$libraries/lib" "$program" "$@"
    elif [ "$compiler" = rustup ]; then
        "qemu-$emulated-static" -L "$libraries" "$program" "$@"
    else
        cp --remove-destination "$program" "$root/src/twofold-$target"
        inside "qemu-$emulated" -L "/usr/$cross" "/src/twofold-$target" "$@"
    fi
}

# Exponents of switches with a past, digit by digit: none is in a figure. A line is the question's flags and the answer's facts.
exponents() {
    while IFS='|' read -r question facts; do
        # shellcheck disable=SC2086
        said=$(on_it lyapunov $question --quiet --format json < /dev/null 2>> "$work/$target.said" | sed 's/.*"facts"://; s/,"made_by".*//')
        [ "$said" = "$facts" ] || { echo "lyapunov $question: not the same: $said"; return 1; }
    done < "$here/../tests/data/late-exponents.txt"
    echo "exponents the same"
}

bad=0
for target in "$@"; do
    case $target in
        aarch64) triple=aarch64-unknown-linux-gnu cross=aarch64-linux-gnu ;;
        s390x) triple=s390x-unknown-linux-gnu cross=s390x-linux-gnu ;;
        i686) triple=i686-unknown-linux-gnu cross=i686-linux-gnu ;;
        riscv64) triple=riscv64gc-unknown-linux-gnu cross=riscv64-linux-gnu ;;
        wasm32) triple=wasm32-wasip1 cross= ;;
        windows) triple=x86_64-pc-windows-gnu cross=x86_64-w64-mingw32 ;;
        *) echo "$target: not one of aarch64, s390x, i686, riscv64, wasm32, windows"; exit 2 ;;
    esac
    emulated=$target
    [ "$target" != i686 ] || emulated=i386
    compiler=${COMPILER:-}
    [ -n "$compiler" ] || if by_rustup; then compiler=rustup; else compiler=debian; fi
    [ "$target $compiler" != "windows debian" ] || { echo "$target: Debian's compiler has no standard library for it; rustup's, or $cross-gcc, is missing"; bad=1; continue; }
    [ "$compiler" != rustup ] || by_rustup || { echo "$target: rustup has no standard library for it, or $cross-gcc is missing"; bad=1; continue; }
    if [ "$only" != run ]; then
        build > "$work/$target.build.log" 2>&1 || { echo "$target: NOT BUILT: see $work/$target.build.log"; bad=1; continue; }
    fi
    [ "$only" != build ] || continue
    begun=$(date +%s)
    # shellcheck disable=SC2086
    on_it $run --quiet --threads "$threads" > "$work/$target.txt" 2> "$work/$target.said"
    found=$?
    [ "$found" -eq 0 ] || bad=1
    also=
    [ -n "${RUN:-}" ] || also=", $(exponents)" || bad=1
    took=$(($(date +%s) - begun))
    case $run in
        check*)
            # The first that is not the same, and which layer of it.
            result="$(grep -c ': same ' "$work/$target.txt") pictures the same"
            [ "$found" -eq 0 ] || result="$result, exit code $found: $(grep -v ': same ' "$work/$target.txt" | head -n 3 | tr '\n' ' ')$(tail -n 1 "$work/$target.said")"
            ;;
        *) result="exit code $found: $(grep . "$work/$target.txt" | tail -n 1)$(tail -n 1 "$work/$target.said")" ;;
    esac
    echo "$(date -u +%F) | $target | $(cat "$work/$target-$compiler/compiler") | $threads thread | $run | $result$also | $took s" | tee -a "$work/report.txt"
done
exit "$bad"
