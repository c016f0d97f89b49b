#!/usr/bin/env bash
# PyWavelets 1.9.0: at the default precision a row of cwt at 0.4 Hz answers to a tone of 102 Hz, and every row is half a
# sample late.
#
# Guess: 4001 samples at 400 Hz of a tone of 102 Hz have next to no energy in the row of 0.4 Hz, and a burst that is
#        symmetrical about a sample is symmetrical about it in each row too.
# Seen:  the row of 0.4 Hz has 192 times the energy of that of 102 Hz. Its wavelet lasts 16000 samples and is read from a
#        table of 4096 points, so that values repeat about four times each, and the repetition beats with the tone.
#        precision=15 leaves a ten-thousandth. A burst about sample 200 has its centre of energy at 200.5.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check PyWavelets==1.9.0 numpy==2.4.6
cd "$folder"
cat > run.py <<'PYTHON'
import numpy as np
import pywt

WAVELET, RATE = "cmor2.0-1.0", 400.0
time = np.arange(4001) / RATE
tone = np.sin(2 * np.pi * 102.0 * time)
scales = pywt.frequency2scale(WAVELET, np.array([0.4, 102.0]) / RATE)
shares = {}
for precision in (12, 15):
    rows = pywt.cwt(tone, scales, WAVELET, precision=precision)[0]
    low, own = (np.abs(rows[:, 1000:3001]) ** 2).mean(axis=1)
    shares[precision] = low / own
    print(f"precision {precision}: energy at 0.4 Hz is {low / own:.3g} times that at 102 Hz, the tone's own frequency")

sample = np.arange(401)
burst = np.exp(-(((sample - 200) / 6.0) ** 2)) * np.cos(0.3 * (sample - 200))
energy = np.abs(pywt.cwt(burst, [10.0, 20.0], WAVELET)[0]) ** 2
centres = (energy * sample).sum(axis=1) / energy.sum(axis=1)
print(f"a burst about sample 200 is centred at {centres.round(2)}")

assert shares[12] > 100, shares
assert shares[15] < 0.001, shares
assert np.all(np.abs(centres - 200.5) < 0.02), centres
PYTHON
venv/bin/python run.py
