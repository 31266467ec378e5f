"""Learning to adapt (SAVN): the recurrent network, which changes its own weights during an episode."""
