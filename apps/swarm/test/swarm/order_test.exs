defmodule Swarm.OrderTest do
  use ExUnit.Case, async: true
  alias Robot.Command
  alias Swarm.Order

  test "valid commands of people pass unchanged" do
    for text <- ~w(goto:1:2 goto:1:2:3 move:0.1:0 findblob findblob:Red lead follow:1:2:0
                   followtheleader:mag2 look:-0.5 start ping) do
      {:ok, command} = Command.parse(text, [:mag2])
      assert Order.check(command) == {:ok, command}
    end
  end

  test "commands that are only between robots are refused by name" do
    for text <- ~w(subscribe:mag2 unsubscribe:mag2 position:1:2:3 blob:1:2:3:0.1:1) do
      {:ok, command} = Command.parse(text, [:mag2])
      assert {:error, line} = Order.check(command)
      assert line =~ hd(String.split(text, ":"))
    end
  end
end
