defmodule Swarm.Agreement.Round.Record do
  @moduledoc false
  # Describes what a round agrees on: the report of each member of its view, and a digest by which two robots
  # know that they hold the same. Pure.
  alias Swarm.Agreement.Election
  alias Swarm.Agreement.Round.Letter

  # The version of this layout and of the computations on a record: robots of different versions
  # must not believe that they agree.
  @version 3

  @enforce_keys [:id, :view, :reports, :digest]
  defstruct @enforce_keys

  @type reports :: %{atom() => Election.report()}
  @type t :: %__MODULE__{
          id: Letter.id(),
          view: [atom()],
          reports: reports(),
          digest: binary() | nil
        }

  @doc """
  The reports of a whole view, with `nil` for a robot that was silent until the deadline.

      iex> report = %{merit: nil, pose: {0, 0, 0}, led: 0, of: 0}
      iex> Swarm.Agreement.Round.Record.freeze([:mag1, :mag2], %{mag2: report}) == %{mag1: nil, mag2: report}
      true
  """
  @spec freeze([atom()], reports()) :: reports()
  def freeze(view, reports), do: Map.new(view, &{&1, Map.get(reports, &1)})

  @doc """
  The digest of frozen reports, computed over a fixed layout of whole numbers and names, sorted by
  name, never over the external format of a term.

      iex> report = %{merit: 900, pose: {1, 2, 3}, led: 0, of: 0}
      iex> a = Swarm.Agreement.Round.Record.digest({1, 1, :mag1}, %{mag1: report, mag2: nil})
      iex> a == Swarm.Agreement.Round.Record.digest({1, 1, :mag1}, %{mag2: nil, mag1: report})
      true
      iex> a == Swarm.Agreement.Round.Record.digest({1, 1, :mag1}, %{mag1: %{report | merit: 901}, mag2: nil})
      false
  """
  @spec digest(Letter.id(), reports()) :: binary()
  def digest({epoch, counter, initiator}, reports) do
    lines = for {id, report} <- Enum.sort(reports), do: line(Atom.to_string(id), report)
    head = "#{@version}/#{epoch}/#{counter}/"
    :crypto.hash(:sha256, [head, Atom.to_string(initiator), "/", lines])
  end

  defp line(name, nil), do: [name, ":-;"]

  defp line(name, %{merit: merit, pose: {x, y, heading}} = report) do
    numbers =
      for n <- [merit || 0, x, y, heading, report.led, report.of],
          do: [",", Integer.to_string(n)]

    [name, ":", if(merit, do: "1", else: "0"), numbers, ";"]
  end
end
