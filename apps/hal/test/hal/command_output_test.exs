defmodule Hal.CommandOutputTest do
  use ExUnit.Case, async: true
  doctest Hal.CommandOutput
end
