"""From lake to tensors: samples for forecasting models, from any dataset, without a cache."""
