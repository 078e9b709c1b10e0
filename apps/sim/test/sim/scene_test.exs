defmodule Sim.SceneTest do
  use ExUnit.Case, async: true

  doctest Sim.Scene
end
