"""Applications on top of the data and simulator packages: command line, web page, report, Dask clusters, notebooks."""
