"""The handles :class:`~scenarionet_data.Lake` and :class:`~scenarionet_data.Database`."""
