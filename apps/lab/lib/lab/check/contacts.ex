defmodule Lab.Check.Contacts do
  @moduledoc false
  # Judges `collision`: contacts of `Sim.World` are none, of a robot with a robot, alive or dead, or with a wall. Pure.
  @behaviour Lab.Check.Kind
  import Lab.Check.Violation, only: [decimals: 2]
  alias Lab.Check.Violation

  @impl Lab.Check.Kind
  def new(_options), do: 0

  # The world keeps the newest contacts.
  @impl Lab.Check.Kind
  def note(_asked, %{world: %{collisions: all, contacts: newest}}, known) do
    wrong =
      for {at_ms, parties, with} <- Enum.take(newest, all - known) do
        speeds =
          Enum.map_join(parties, ", ", fn {id, {x, y}, speed} ->
            "#{id} at #{decimals(x, 2)},#{decimals(y, 2)} with #{decimals(speed, 2)} m/s"
          end)

        figures = if with == :wall, do: "wall, " <> speeds, else: speeds
        Violation.new(:collision, at_ms, Enum.map(parties, &elem(&1, 0)), figures)
      end

    {:never, Enum.reverse(wrong), all}
  end
end
