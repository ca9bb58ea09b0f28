#!/bin/sh
# Writes tests/differential.txt: what QEMU prints for the differential program.
# Needs qemu-system-arm; the committed file is from QEMU 7.2.22 (Debian 12).
set -eu
cd "$(dirname "$0")"
cargo build --release --target thumbv7em-none-eabihf --target-dir target
qemu-system-arm -M mps2-an386 -display none -monitor none -serial none \
    -semihosting-config enable=on,target=native \
    -kernel target/thumbv7em-none-eabihf/release/differential 2> ../tests/differential.txt
tail -n 1 ../tests/differential.txt | grep -qx END
