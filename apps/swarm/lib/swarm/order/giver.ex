defmodule Swarm.Order.Giver do
  @moduledoc """
  Names who gives an order, as people call it: `page 127.0.0.1:5123`, `terminal of demo@desk`, or the node where nothing
  else is known. The text goes with the order to the robot, which logs and records it. It gives no right to anything. Pure.
  """

  @most 60

  @doc """
  The text as it goes with an order; `nil` for what is no text of at most #{@most} printable bytes (ASCII).

      iex> alias Swarm.Order.Giver
      iex> Giver.text("page 127.0.0.1:5123")
      "page 127.0.0.1:5123"
      iex> for junk <- ["", "two\\nlines", "caf\\u00e9", String.duplicate("a", 61), :page], do: Giver.text(junk)
      [nil, nil, nil, nil, nil]
  """
  @spec text(term()) :: String.t() | nil
  def text(text) when is_binary(text) and byte_size(text) in 1..@most,
    do: if(for(<<byte <- text>>, byte not in 0x20..0x7E, do: byte) == [], do: text)

  def text(_other), do: nil

  @doc """
  The giver of an order that arrived with this text, and the reference for its answer: without such a text the node that
  asks, and `nil` where that is not known either, as in lockstep.

      iex> alias Swarm.Order.Giver
      iex> Giver.of("gamepad", make_ref())
      "gamepad"
      iex> {Giver.of("\\e[2J", make_ref()), Giver.of(nil, nil)}
      {"nonode@nohost", nil}
  """
  @spec of(term(), reference() | nil) :: String.t() | nil
  def of(text, nil), do: text(text)
  def of(text, ref) when is_reference(ref), do: text(text) || node_text(node(ref))

  @doc "The text for a node."
  @spec node_text(node()) :: String.t() | nil
  def node_text(node), do: node |> Atom.to_string() |> String.slice(0, @most) |> text()
end
