defmodule Mcap.Samples do
  @moduledoc "Files of known messages."
  alias Mcap.Writer

  @schema {"Number", "jsonschema", ~s({"type":"object","properties":{"n":{"type":"integer"}}})}

  @doc "A file of these `{topic, ns, data}` in chunks of some messages each, and where each piece of it ended."
  @spec file([{String.t(), non_neg_integer(), binary()}], keyword()) :: {binary(), [binary()]}
  def file(messages, options \\ []) do
    {each, options} = Keyword.pop(options, :each, 5)
    {t, head} = Writer.new(options)
    {t, note} = Writer.metadata(t, "made by", %{"b" => "2", "a" => "1"})

    {t, pieces} =
      messages
      |> Enum.chunk_every(each)
      |> Enum.reduce({t, [note, head]}, fn some, {t, pieces} ->
        t = Enum.reduce(some, t, &add/2)
        {t, piece} = Writer.flush(t)
        {t, [piece | pieces]}
      end)

    pieces = Enum.reverse([Writer.finish(t) | pieces]) |> Enum.map(&IO.iodata_to_binary/1)
    {IO.iodata_to_binary(pieces), pieces}
  end

  defp add({topic, ns, data}, t) do
    schema = if topic == "/plain", do: nil, else: @schema
    {id, t} = Writer.channel(t, topic, "json", schema, %{"topic" => topic})
    {t, []} = Writer.message(t, id, ns, data)
    t
  end

  @doc "So many messages of three topics, some ms apart, drawn by a state of `:rand`."
  @spec messages(non_neg_integer(), :rand.state()) :: {[tuple()], :rand.state()}
  def messages(count, state) do
    {messages, {_ns, state}} =
      Enum.map_reduce(1..count//1, {1_700_000_000_000_000_000, state}, fn n, {ns, state} ->
        {step, state} = :rand.uniform_s(3, state)
        {topic, state} = :rand.uniform_s(3, state)
        ns = ns + (step - 1) * 1_000_000
        topic = Enum.at(["/a", "/b", "/plain"], topic - 1)
        {{topic, ns, ~s({"n":#{n}})}, {ns, state}}
      end)

    {messages, state}
  end

  @doc "What a file has, as `{topic, ns, data}`."
  @spec read(Path.t(), keyword()) :: [{String.t(), non_neg_integer(), binary()}]
  def read(path, options \\ []) do
    {:ok, t} = Mcap.Reader.open(path)
    for {topic, _channel, ns, data} <- Mcap.Reader.messages(t, options), do: {topic, ns, data}
  end
end
