"""Images of simulations: converts worlds and states to what :mod:`scenarionet_data.plots` draws.

Needs matplotlib (extra ``plots``), and PyAV for mp4 (extra ``video``); only windows need a display.
"""
