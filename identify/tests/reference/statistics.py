"""The statistics of identify, by SciPy and statsmodels. Reads a question as JSON, prints the answers as JSON."""

import json
import sys

import numpy as np
from scipy import stats
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.tsa.stattools import acf, ccf

question = json.load(sys.stdin)
x, y, lags = np.array(question["x"]), np.array(question["y"]), question["lags"]
test = acorr_ljungbox(x, lags=[lags], return_df=True)
json.dump(
    {
        "autocorrelation": acf(x, nlags=lags, adjusted=False, fft=False).tolist(),
        "cross_correlation": ccf(x, y, adjusted=False, fft=False)[: lags + 1].tolist(),
        "ljung_box": [float(test["lb_stat"].iloc[0]), float(test["lb_pvalue"].iloc[0])],
        "normal_quantile": [float(stats.norm.ppf(p)) for p in question["probabilities"]],
        "student_quantile": [
            [float(stats.t.ppf(p, freedom)) for p in question["probabilities"]] for freedom in question["freedoms"]
        ],
        "chi_square_tail": [
            [float(stats.chi2.sf(value, freedom)) for value in question["values"]] for freedom in question["freedoms"]
        ],
    },
    sys.stdout,
)
