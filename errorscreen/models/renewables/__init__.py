"""Plants behind converters."""
