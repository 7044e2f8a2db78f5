"""The commands as pipelines: scenarios or folders in, finished folders out."""
