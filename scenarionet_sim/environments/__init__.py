"""Gymnasium's and PettingZoo's faces of worlds with agents; ``config`` says what each is made of."""
