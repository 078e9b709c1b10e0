defmodule Agents.Template do
  @moduledoc """
  Filters envelopes by a description that is data. Pure.

      [performative: :inform, from: :mag1]                  all of these fields
      [performative: [:agree, :refuse]]                     a list: one of these
      [content: fn content -> is_map(content) end]          a function of one argument tells
      [content: :battery]                                   or a value that is equal
      {:any, [[from: :mag1], [class: :urgent]]}             or
      {:all, [[from: :mag1], {:not, [content: :battery]}]}  and, not
      []                                                    every envelope

  A function gets the content as it came from outside, so it should return `false` for what it
  does not know. It is the owner's code: if it raises, its owner crashes.
  """
  alias Agents.Envelope

  @fields [
    :performative,
    :from,
    :conversation,
    :reply_to,
    :in_reply_to,
    :epoch,
    :topic,
    :class,
    :content
  ]

  @type field :: {atom(), term()}
  @type t :: [field()] | {:all, [t()]} | {:any, [t()]} | {:not, t()}

  @doc """
  Checks a template; the error says what is wrong with it. To be called where a template is passed
  in, because `match?/2` does not check it again.

      iex> Agents.Template.check([from: :mag1])
      {:ok, [from: :mag1]}
      iex> Agents.Template.check([speed: 1])
      {:error, "an envelope has no field :speed; allowed are performative, from, conversation, reply_to, in_reply_to, epoch, topic, class, content"}
  """
  @spec check(term()) :: {:ok, t()} | {:error, line :: String.t()}
  def check(template) do
    case fault(template) do
      nil -> {:ok, template}
      line -> {:error, line}
    end
  end

  @doc """
  Whether an envelope matches a template.

      iex> envelope = Agents.Envelope.new(:inform, :mag1, {:battery, 11.8})
      iex> Agents.Template.match?([performative: :inform, from: [:mag1, :mag2]], envelope)
      true
      iex> Agents.Template.match?({:not, [content: {:battery, 11.8}]}, envelope)
      false
  """
  @spec match?(t(), Envelope.t()) :: boolean()
  def match?([], %Envelope{}), do: true

  def match?([{field, wanted} | rest], envelope),
    do: field?(field, wanted, Map.fetch!(envelope, field)) and __MODULE__.match?(rest, envelope)

  def match?({:all, templates}, envelope),
    do: Enum.all?(templates, &__MODULE__.match?(&1, envelope))

  def match?({:any, templates}, envelope),
    do: Enum.any?(templates, &__MODULE__.match?(&1, envelope))

  def match?({:not, template}, envelope), do: not __MODULE__.match?(template, envelope)

  defp field?(:content, wanted, content) when is_function(wanted, 1), do: wanted.(content) == true
  defp field?(:content, wanted, content), do: wanted === content
  defp field?(_field, wanted, value) when is_list(wanted), do: value in wanted
  defp field?(_field, wanted, value), do: value === wanted

  defp fault([]), do: nil

  defp fault([{field, _wanted} | rest]) when field in @fields, do: fault(rest)

  defp fault([{field, _wanted} | _rest]),
    do: "an envelope has no field #{inspect(field)}; allowed are #{Enum.join(@fields, ", ")}"

  defp fault({:not, template}), do: fault(template)

  defp fault({which, templates}) when which in [:all, :any] and is_list(templates) do
    if List.improper?(templates),
      do: "#{inspect(templates)} is not a list of templates",
      else: Enum.find_value(templates, &fault/1)
  end

  defp fault(other),
    do:
      "#{inspect(other)} is not a template; write fields as [from: :mag1], or {:all, …}, {:any, …}, {:not, …}"
end
