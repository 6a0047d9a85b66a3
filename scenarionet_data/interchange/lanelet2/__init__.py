"""Lanelet2 (https://github.com/fzi-forschungszentrum-informatik/Lanelet2) maps, as Autoware reads them."""
