defmodule Record.Recording.Terms do
  @moduledoc false
  # Terms of a robot in a form that another VM can read. Pure.
  #
  # A reference or a process belongs to its node, and its bytes name that node by an atom, which a
  # reader would not know. Here it is a text; read again, it is one of the reader's node, with the
  # same text. Those of one robot stay different from each other, and equal ones stay equal.
  #
  # A profile is written once for the robot, not in each percept, in which that of a body with a lidar has its beams for sonars.
  alias Hal.{Profile, Scan}

  @reference :"$convoy_reference"
  @process :"$convoy_process"
  @profile :"$convoy_profile"
  @ring :"$convoy_ring"

  @doc """
  The term, with texts for references and processes, and a mark for this profile.

      iex> reference = make_ref()
      iex> {_mark, text} = Record.Recording.Terms.portable(reference, nil)
      iex> text == inspect(reference) |> String.replace("Reference", "Ref")
      true
      iex> term = %{list: [{1.5, reference} | :improper]}
      iex> term |> Record.Recording.Terms.portable(nil) |> Record.Recording.Terms.local(nil)
      {:ok, term}
  """
  @spec portable(term(), Profile.t() | nil) :: term()
  def portable(%Profile{} = profile, profile), do: @profile

  def portable(%Profile{scan: %{}} = heard, %Profile{} = profile) do
    if heard == Scan.ring(profile), do: @ring, else: mapped(heard, &portable(&1, profile))
  end

  def portable(map, profile) when is_map(map), do: mapped(map, &portable(&1, profile))

  def portable(tuple, profile) when is_tuple(tuple),
    do: tuple |> Tuple.to_list() |> Enum.map(&portable(&1, profile)) |> List.to_tuple()

  def portable([first | rest], profile), do: [portable(first, profile) | portable(rest, profile)]

  def portable(reference, _profile) when is_reference(reference),
    do: {@reference, own(:erlang.ref_to_list(reference))}

  def portable(pid, _profile) when is_pid(pid), do: {@process, own(:erlang.pid_to_list(pid))}
  def portable(other, _profile), do: other

  # The first number is that of the node.
  defp own(text), do: Regex.replace(~r/<\d+\./, List.to_string(text), "<0.", global: false)

  @doc "The term again; `:error` for what `portable/2` does not write."
  @spec local(term(), Profile.t() | nil) :: {:ok, term()} | :error
  def local(term, profile) do
    {:ok, read(term, profile)}
  rescue
    # A text that is none of a reference.
    ArgumentError -> :error
  end

  defp read(@profile, profile), do: profile
  defp read(@ring, %Profile{} = profile), do: Scan.ring(profile)
  defp read(map, profile) when is_map(map), do: mapped(map, &read(&1, profile))

  defp read({@reference, text}, _profile) when is_binary(text),
    do: text |> String.to_charlist() |> :erlang.list_to_ref()

  defp read({@process, text}, _profile) when is_binary(text),
    do: text |> String.to_charlist() |> :erlang.list_to_pid()

  defp read(tuple, profile) when is_tuple(tuple),
    do: tuple |> Tuple.to_list() |> Enum.map(&read(&1, profile)) |> List.to_tuple()

  defp read([first | rest], profile), do: [read(first, profile) | read(rest, profile)]
  defp read(other, _profile), do: other

  # Keys are mostly atoms, and then stay as they are.
  defp mapped(map, change) do
    if Enum.all?(Map.keys(map), &is_atom/1),
      do: :maps.map(fn _key, value -> change.(value) end, map),
      else: map |> :maps.to_list() |> Map.new(fn {k, v} -> {change.(k), change.(v)} end)
  end
end
