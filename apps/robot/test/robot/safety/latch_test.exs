defmodule Robot.Safety.LatchTest do
  use Robot.Case, async: false

  test "the gate tells the e-stop role when its latch was set or cleared directly, after it was" do
    id = robot(:latch1)
    :ok = Names.register(id, :estop, nil)
    :ok = Gate.estop(id)
    assert_receive {:"$gen_cast", :latch}
    assert Board.latched?(Board.find!(id))
    :ok = Gate.reset(id)
    assert_receive {:"$gen_cast", :latch}
    refute Board.latched?(Board.find!(id))
  end

  test "the e-stop role latches the gate without waiting, and is told when it is unlatched, unless it was pressed since" do
    id = robot(:latch2)
    :ok = Names.register(id, :estop, nil)
    :ok = Gate.latch(id, {Kernel, :send, [self(), :latched]})
    assert_receive :latched
    assert Board.latched?(Board.find!(id))
    :ok = Gate.estop(id)
    assert_receive {:"$gen_cast", :latch}
    :ok = Gate.unlatch(id, 0, :first)
    assert_receive {:"$gen_cast", {:unlatched, {:error, :pressed}, :first}}
    assert Board.latched?(Board.find!(id))
    :ok = Gate.unlatch(id, 1, :second)
    assert_receive {:"$gen_cast", {:unlatched, :ok, :second}}
    refute Board.latched?(Board.find!(id))
  end
end
