defmodule Lab.DocTest do
  use ExUnit.Case, async: true
  doctest Lab
  doctest Lab.Fleet.Mission
  doctest Lab.Fleet.PendingStages
  doctest Lab.Trial.Cuts
  doctest Lab.Trial.Memory
  doctest Lab.Trial.Options
end
