defmodule Lab.LockstepCase do
  @moduledoc """
  For tests that reckon all the time: their processes let those of robots in real time, which
  share the VM, go first.
  """
  use ExUnit.CaseTemplate

  setup_all do
    Process.flag(:priority, :low)
    :ok
  end

  setup do
    Process.flag(:priority, :low)
    Lab.Trial.Memory.prepare()
    :ok
  end
end
