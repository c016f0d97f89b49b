"""From responses to the images that the network reads: error, whitening, wavelet energy, scaling."""

from errorscreen.features.cwt import CWTTransformer
from errorscreen.features.filterbank import FilterBank
from errorscreen.features.response_error import ResponseErrorTransformer
from errorscreen.features.scaling import ChannelScaler
from errorscreen.features.whitening import ErrorWhitener

__all__ = ["CWTTransformer", "ChannelScaler", "ErrorWhitener", "FilterBank", "ResponseErrorTransformer"]
