defmodule Robot.Behaviour.Rest do
  @moduledoc "Stands still while no other behaviour has a wish: its wish has a very small weight."
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
    do: {:running, Wish.new(:rest, Twist.zero(), 0.05), {__MODULE__, state}}
end
