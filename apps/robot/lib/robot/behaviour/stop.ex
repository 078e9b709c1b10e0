defmodule Robot.Behaviour.Stop do
  @moduledoc "Ends any movement: wishes to stand, with the greatest weight, until replaced."
  @behaviour Robot.Behaviour
  alias Hal.Twist
  alias Robot.Wish

  @impl Robot.Behaviour
  def new(options \\ []) do
    _ = Keyword.validate!(options, [])
    {__MODULE__, nil}
  end

  @impl Robot.Behaviour
  def tick(_percept, state),
    do: {:running, Wish.new(:stop, Twist.zero(), 1.0), {__MODULE__, state}}
end
