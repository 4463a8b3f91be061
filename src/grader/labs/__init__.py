"""Labs: the small simulations that authors write in JSON, run on the server by the same MuJoCo that grades."""
