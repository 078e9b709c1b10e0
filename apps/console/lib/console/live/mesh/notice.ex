defmodule Console.Live.Mesh.Notice do
  @moduledoc "Explains in one line for people why no robot of a mesh is shown, or not the one that was meant. Pure."

  # Nodes of another secret go on sending; for so long after the last of their datagrams they are told of.
  @stranger_ms 10_000

  @enforce_keys [:connect]
  defstruct @enforce_keys ++ [line: nil, unsigned: 0, stranger_ms: nil]

  @type t :: %__MODULE__{}

  @typedoc """
  What is known now: how many robots are heard, which nodes (`nil` without a mesh), how many datagrams were not signed
  with the secret since the start, and what is wrong with this machine's network.
  """
  @type seen :: %{
          robots: non_neg_integer(),
          nodes: [String.t()] | nil,
          unsigned: non_neg_integer(),
          fault: String.t() | nil
        }

  @doc "Nothing is known yet; `connect` is the node that is expected."
  @spec new(String.t() | nil) :: t()
  def new(connect), do: %__MODULE__{connect: connect}

  @doc """
  Looks again; `line` is what there is to say.

      iex> alias Console.Live.Mesh.Notice
      iex> alone = %{robots: 0, nodes: [], unsigned: 0, fault: nil}
      iex> Notice.look(Notice.new("mag1@convoy"), alone, 0).line
      "mag1@convoy is not heard, nor is any other node; it is shown as soon as it is"
      iex> Notice.look(Notice.new(nil), %{alone | unsigned: 3}, 0).line
      "no node is heard, but some that have another secret: is CONVOY_SECRET_FILE that of this fleet?"
      iex> Notice.look(Notice.new(nil), %{alone | nodes: ["mag1@convoy"], robots: 1}, 0).line
      nil
  """
  @spec look(t(), seen(), now_ms :: integer()) :: t()
  def look(notice, seen, now_ms) do
    stranger_ms = if seen.unsigned > notice.unsigned, do: now_ms, else: notice.stranger_ms
    strangers? = stranger_ms != nil and now_ms - stranger_ms < @stranger_ms
    line = line(notice.connect, seen, strangers?)
    %{notice | line: line, unsigned: seen.unsigned, stranger_ms: stranger_ms}
  end

  defp line(_connect, %{fault: fault}, _strangers?) when fault != nil, do: "no network: #{fault}"

  defp line(_connect, %{nodes: [], robots: 0}, true),
    do:
      "no node is heard, but some that have another secret: is CONVOY_SECRET_FILE that of this fleet?"

  defp line(nil, %{nodes: [], robots: 0}, _strangers?),
    do: "no node is heard; robots are shown as soon as they are"

  defp line(connect, %{nodes: [], robots: 0}, _strangers?),
    do: "#{connect} is not heard, nor is any other node; it is shown as soon as it is"

  defp line(_connect, %{robots: 0}, _strangers?),
    do: "no robot is heard; robots are shown as soon as they are"

  defp line(connect, %{nodes: nodes}, _strangers?) do
    if connect != nil and nodes != nil and connect not in nodes,
      do: "#{connect} is not heard; it is shown as soon as it is"
  end
end
