"""Runs a WASI program under wasmtime (pip install wasmtime) with its arguments, and exits as it
does."""

import os
import sys

import wasmtime

engine = wasmtime.Engine()
store = wasmtime.Store(engine)
wasi = wasmtime.WasiConfig()
wasi.argv = ["twofold", *sys.argv[2:]]
wasi.inherit_stdout()
wasi.inherit_stderr()
wasi.preopen_dir(os.getcwd(), ".")
store.set_wasi(wasi)
linker = wasmtime.Linker(engine)
linker.define_wasi()
instance = linker.instantiate(store, wasmtime.Module.from_file(engine, sys.argv[1]))
try:
    instance.exports(store)["_start"](store)
except wasmtime.ExitTrap as trap:
    sys.exit(trap.code)
