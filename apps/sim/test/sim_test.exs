defmodule SimTest do
  use ExUnit.Case, async: true
  doctest Sim
end
