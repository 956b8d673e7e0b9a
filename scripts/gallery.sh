#!/bin/sh
# A picture of every system that ships, drawn by `twofold plot` into a folder: scripts/gallery.sh PROGRAM FOLDER
set -eu
program=$1
folder=$2
mkdir -p "$folder"
plot() {
    name=$1
    shift
    "$program" plot --quiet --system "$name" --out "$folder/$name.png" "$@"
    echo "$folder/$name.png"
}
filippov="--switch filippov --exit at-once:plus"
# shellcheck disable=SC2086 # the words of $filippov are arguments
{
    plot caricature --reading reconstructed --t-end 60 --camera -50,20
    plot caricature-as-printed --reading reconstructed --t-end 60 --camera -50,20
    plot two-fold --switch filippov --exit after-time:0.6:plus --start 0.1,0.1,0.5 --t-end 4 --camera -50,20
    plot wheel --t-end 20 --camera -115,18
    plot relay-linear $filippov --t-end 12
    plot relay-parabolic $filippov --t-end 3.9
    plot stick-slip $filippov --t-end 30
    plot dry-friction $filippov --t-end 60
    plot friction-pair $filippov --t-end 40 --kind series --axes x1,x2,v1
    plot relay-third-order $filippov --t-end 40
    plot chua --t-end 120 --camera -60,15
    plot gene-switch $filippov --t-end 12
    plot fused-focus $filippov --set mu=-0.01 --t-end 120
    plot relay-square $filippov --t-end 6
    plot two-blocks $filippov --t-end 40
    plot bouncing-ball --t-end 5 --kind series
    plot impact-oscillator --t-end 60
    plot relay-hysteresis --t-end 40
    plot three-blocks --t-end 40 --kind series --axes x1,x2,v1
    plot sliding-mode-control --t-end 6
    plot buck --set input=33 --t-end 0.02
    plot cuk-converter --t-end 0.02
    plot rimless-wheel --t-end 20
    plot driven-by-data --t-end 160
}
