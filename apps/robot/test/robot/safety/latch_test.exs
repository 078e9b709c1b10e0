defmodule Robot.Safety.LatchTest do
  use Robot.Case, async: false

  test "the gate says when its latch was set or cleared, after it was" do
    test = self()
    id = robot(:latch1, on_latch: {__MODULE__, :latched, [test, :latch1]})
    :ok = Gate.estop(id)
    assert_receive {:latched, true}
    :ok = Gate.reset(id)
    assert_receive {:latched, false}
  end

  @doc false
  def latched(test, id), do: send(test, {:latched, Board.latched?(Board.find!(id))})
end
