"""The regularised extreme learning machine: random hidden layer, MRSR ordering, PRESS selection."""
